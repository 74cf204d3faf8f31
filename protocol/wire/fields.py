"""Fields: what stands at each place of a message, said once, where the message is declared.

    urgency: Annotated[float, field("largest |error| known in this epoch", unit="rad", ge=0)]

From this follow what a receiver refuses, the tables of `protocol/README.md` and the schemas of
`run.mcap`. A bound is checked by msgspec while it reads; NaN is beyond any.
"""

from functools import cache
from types import GenericAlias
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

from msgspec import Meta


def field(
    meaning: str,
    *,
    unit: str = "",
    ge: float | None = None,
    le: float | None = None,
    difference: bool = False,
) -> Meta:
    """Describe a field; `ge` and `le` are the least and the largest that it may be.

    A `difference` is sent as the difference to the entry before in the same frame.
    """
    return Meta(description=meaning, ge=ge, le=le, extra={"unit": unit, "difference": difference})


class Field(NamedTuple):
    """What is known of a field."""

    name: str
    type: Any
    """int, float, str or bytes; or the named tuple whose fields stand in an array of its own."""
    repeats: bool
    """Any number of these in an array."""
    meaning: str
    unit: str
    ge: float | None
    le: float | None
    difference: bool


@cache
def fields(message: Any) -> tuple[Field, ...]:
    """Give the fields of a message, or of a part of one, in their order."""
    hints = get_type_hints(message, include_extras=True)
    return tuple(_field(name, *get_args(hint)[:2]) for name, hint in hints.items())


def _field(name: str, of: Any, meta: Meta) -> Field:
    repeats = get_origin(of) is tuple
    extra = meta.extra or {}
    return Field(
        name,
        get_args(of)[0] if repeats else of,
        repeats,
        meta.description or "",
        extra.get("unit", ""),
        meta.ge,
        meta.le,
        extra.get("difference", False),
    )


def without_bounds(message: Any) -> Any:
    """Give the type that any message of these fields has, in range or not: tuples of plain ones."""
    if not hasattr(message, "_fields"):
        return message
    inner = [(without_bounds(of.type), of.repeats) for of in fields(message)]
    places = tuple(GenericAlias(tuple, (of, ...)) if many else of for of, many in inner)
    return GenericAlias(tuple, places)
