"""Markdown tables, and the sentences that stand below attributes in the code."""

import ast
import inspect
import sys
import textwrap
from collections.abc import Iterable, Sequence


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Give a Markdown table; bars within a cell are escaped, line breaks become spaces."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(map(_cell, line))} |" for line in lines)


def attribute_docs(kind: type) -> dict[str, str]:
    """Give the docstring below each attribute of a class, those of its parents included.

    Parents are read from the source as well: a `TypedDict` does not remember its own.
    """
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
    assert isinstance(definition, ast.ClassDef)
    names = vars(sys.modules[kind.__module__])
    parents = [names.get(ast.unparse(parent)) for parent in definition.bases]
    found: dict[str, str] = {}
    for parent in parents:
        if isinstance(parent, type) and parent.__module__.partition(".")[0] in OURS:
            found.update(attribute_docs(parent))
    for attribute, text in zip(definition.body, definition.body[1:], strict=False):
        match attribute, text:
            case (
                ast.AnnAssign(target=ast.Name(id=name)) | ast.Assign(targets=[ast.Name(id=name)]),
                ast.Expr(value=ast.Constant(value=str(doc))),
            ):
                found[name] = " ".join(doc.split())
    return found


OURS = {"protocol", "module_agent", "plant_server", "deploy"}
"""Packages whose classes are read; what others declare is no part of a document."""


def _cell(value: object) -> str:
    return " ".join(str(value).split()).replace("|", "\\|")
