"""The keys of a scenario file, from the tables that check it."""

import json
from collections.abc import Iterator
from typing import Any, get_args, get_origin

from pydantic import BaseModel

from deploy.generated.markdown import attribute_docs, table
from deploy.scenario_file.event_tables import LINK_PATTERN
from deploy.scenario_file.tables import HOST_PATTERN, NAME_PATTERN, ScenarioTable

Schema = dict[str, Any]

UNITS = {
    "nm_s_rad": "N m s/rad",
    "deg_s_per_sqrt_hz": "°/s/√Hz",
    "deg_per_sqrt_hz": "°/√Hz",
    "nm_rad": "N m/rad",
    "nm_s": "N m/s",
    "kg_m2": "kg m²",
    "deg_s": "°/s",
    "per_s": "1/s",
    "ticks": "ticks",
    "ppm": "ppm",
    "deg": "°",
    "nm": "N m",
    "hz": "Hz",
    "ms": "ms",
    "kg": "kg",
    "n": "N",
    "j": "J",
    "m": "m",
    "s": "s",
}
"""Of a key, by how it ends; the first that fits."""
BOUNDS = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
BOUND_MAX = 1e9
"""A larger bound is that of the machine, and not worth a word."""
NAMED = {NAME_PATTERN: "name", LINK_PATTERN: "link", HOST_PATTERN: "address"}
"""What a text with a pattern is."""
CHOICE = "do"
"""The key that says which kind of event a table is."""


def scenario_keys() -> str:
    """Give a heading, a sentence and a table for each TOML table of a scenario file."""
    return "\n\n".join(_sections("", ScenarioTable))


def unit(key: str) -> str:
    """Give the unit that a key has in its name; "" for none."""
    key = key.removesuffix("_max")
    return next((unit for end, unit in UNITS.items() if key.endswith(f"_{end}")), "")


def _sections(heading: str, kind: type[BaseModel]) -> Iterator[str]:
    """Describe a table, and after it those within it; "" is the top level."""
    docs, properties = attribute_docs(kind), kind.model_json_schema()["properties"]
    inner: list[tuple[str, type[BaseModel]]] = []
    rows = []
    for key, field in kind.model_fields.items():
        if tables := list(_tables(field.annotation)):
            name = f"{heading.strip('[]')}.{key}".lstrip(".")
            below = f"[[{name}]]" if get_origin(field.annotation) is list else f"[{name}]"
            inner += [(below, one) for one in tables]
        elif key != CHOICE:
            about = properties[key]
            default = "required" if field.is_required() else _default(about["default"])
            rows.append((f"`{key}`", _type(about), unit(key), default, docs[key]))
    kinds = f", `{CHOICE} = {_choices(properties[CHOICE])}`" if CHOICE in properties else ""
    sentence = " ".join((kind.__doc__ or "").split())
    yield f"### {f'`{heading}`' if heading else 'Top level'}{kinds}\n\n{sentence}"
    if rows:
        yield table(("key", "type", "unit", "default", "meaning"), rows)
    for below, one in inner:
        yield from _sections(below, one)


def _tables(kind: Any) -> Iterator[type[BaseModel]]:
    """Tables that a type is made of: itself, or those of a list or a choice."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        yield kind
    else:
        for inner in get_args(kind):
            yield from _tables(inner)


def _type(about: Schema) -> str:
    """Say in words what a JSON schema allows."""
    match about:
        case {"anyOf": [one, *_]}:  # The other one is null: not given.
            return _type(one)
        case {"type": "array", "items": items}:
            return f"list of {_type(items)}"
        case {"enum": _} | {"const": _}:
            return _choices(about)
        case {"type": "string", "pattern": pattern}:
            return NAMED[pattern]
        case {"type": kind}:
            return f"{kind} {_bounds(about)}".strip()
        case _:
            return "string or table"


def _choices(about: Schema) -> str:
    return " or ".join(f'"{choice}"' for choice in about.get("enum", [about.get("const")]))


def _bounds(about: Schema) -> str:
    least, most = about.get("minimum"), about.get("maximum")
    if least is not None and most is not None:
        return f"{least} … {most}"
    bounds = ((sign, about.get(key)) for key, sign in BOUNDS.items())
    return ", ".join(f"{sign} {at}" for sign, at in bounds if at is not None and at < BOUND_MAX)


def _default(value: object) -> str:
    return "none" if value is None else f"`{json.dumps(value)}`"
