"""The messages of the wire, field by field, as they are declared."""

import re
from collections.abc import Callable
from functools import partial
from typing import Any

from deploy.generated.markdown import table
from protocol.wire.enrolment import EnrolmentReply, EnrolmentRequest
from protocol.wire.fields import Field, fields
from protocol.wire.frames import KINDS

PLAIN = {int: "int", float: "float", str: "str", bytes: "bin"}
HEADER = ("type", "unit", "range", "meaning")
POWERS_FROM = 16
"""Below this power of two or ten a number is written out."""
_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def message_tables() -> dict[str, Callable[[], str]]:
    """Give each message's table by the name of its region."""
    return {
        f"wire-{_region(message)}": partial(_tables, message)
        for message in (*KINDS, EnrolmentRequest, EnrolmentReply)
    }


def _region(message: type) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", message.__name__).lower()


def _tables(message: Any, heading: str = "#") -> str:
    """Give the table of a message, and behind it those of its parts."""
    found = fields(message)
    parts = [of for of in found if of.type not in PLAIN]
    rows = [
        (i, f"`{of.name}`" + (" Δ" if of.difference else ""), _type(of), of.unit, _range(of),
         _sentence(of.meaning))
        for i, of in enumerate(found)
    ]  # fmt: skip
    return "\n\n".join(
        [
            table((heading, "field", *HEADER), rows),
            *(_tables(of.type, f"# in `{of.name}`") for of in parts),
        ]
    )


def _type(of: Field) -> str:
    if of.type in PLAIN:
        return PLAIN[of.type]
    return f"array of {'arrays' if of.repeats else len(fields(of.type))}"


def _range(of: Field) -> str:
    if of.ge is None:
        return "" if of.le is None else f"≤ {_number(of.le)}"
    return f"≥ {_number(of.ge)}" if of.le is None else f"{_number(of.ge)} … {_number(of.le)}"


def _number(value: float) -> str:
    """Write a number as people do, large ones as powers of two or ten."""
    if value < 0:
        return f"−{_number(-value)}"  # noqa: RUF001 - typeset
    for base in (2, 10):
        for less, ending in ((0, ""), (1, " − 1")):  # noqa: RUF001 - typeset
            power = _power(int(value) + less, base)
            if power and base**power >= 2**POWERS_FROM:
                return f"{base}{str(power).translate(_RAISED)}{ending}"
    return f"{value:g}"


def _power(value: int, base: int) -> int:
    """Give the exponent of a power, 0 for what is none."""
    power = 0
    while value > 1 and value % base == 0:
        value, power = value // base, power + 1
    return power if value == 1 else 0


def _sentence(meaning: str) -> str:
    """Mark what has a name in the text around."""
    return re.sub(r"\bNO_(TICK|EPOCH)\b", r"`\g<0>`", meaning)
