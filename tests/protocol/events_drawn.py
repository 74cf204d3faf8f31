"""Events at random, drawn from their types: whoever reads events is shown every member."""

from typing import Any, get_args, get_type_hints

from hypothesis import strategies as st

from protocol.robot import sensors
from protocol.robot.events import (
    ANY,
    BOARDS_MAX,
    DELAY_TICKS_MAX,
    EVENTS,
    RAD_MAX,
    BoardCommand,
    Event,
    LinkChange,
    LinkOrder,
    LinkParameters,
    ReferenceOrder,
    SensorFault,
)

WHOLE = st.integers(0, DELAY_TICKS_MAX).map(float)
PROBABILITY = st.floats(0.0, 1.0)
PARAMETERS: dict[str, st.SearchStrategy[float]] = {
    name: WHOLE if name.endswith("_ticks") else PROBABILITY for name in LinkParameters._fields
} | {"cut": st.sampled_from([0.0, 1.0])}


def annotated_fields(kind: type[Event]) -> dict[str, Any]:
    """The fields of an event, with all that stands beside their types."""
    hints = get_type_hints(kind, include_extras=True)
    return {name: hints[name] for name in kind.__struct_fields__}


def of_type(hint: Any, boards: int = BOARDS_MAX) -> st.SearchStrategy[Any]:
    """Values of an annotated type within its bounds, for a robot of so many boards."""
    ge, end = None, None
    for meta in getattr(hint, "__metadata__", ()):
        ge = meta.ge if meta.ge is not None else ge
        end = meta.le if meta.le is not None else meta.lt - 1 if meta.lt is not None else end
    plain = hint.__origin__ if hasattr(hint, "__metadata__") else hint
    if plain is int:
        return st.integers(ge, boards - 1 if end == BOARDS_MAX - 1 else end)
    if plain is float:
        return st.floats(ge, end, allow_nan=False, allow_infinity=False)
    if plain is str:
        return st.text(max_size=40)
    if getattr(plain, "__origin__", None) is tuple:
        inner, *rest = get_args(plain)
        if rest == [Ellipsis]:
            return st.lists(of_type(inner, boards), max_size=4).map(tuple)
        return st.tuples(*(of_type(inner, boards) for inner in get_args(plain)))
    return st.from_type(plain)


def of_kind(kind: type[Event], boards: int = BOARDS_MAX) -> st.SearchStrategy[Event]:
    """Events of one kind; those of a robot that is not the largest can happen to it."""
    drawn = {name: of_type(hint, boards) for name, hint in annotated_fields(kind).items()}
    if "pairs" in drawn and boards < BOARDS_MAX:
        links = [(a, b) for a in range(boards) for b in (a - 1, a + 1) if 0 <= b < boards]
        drawn["pairs"] = st.lists(st.sampled_from(links), max_size=4, unique=True).map(tuple)
    if kind is LinkChange:
        drawn["changes"] = st.fixed_dictionaries({}, optional=PARAMETERS).filter(bool)
    if kind is SensorFault:
        return st.sampled_from(sensors.FAULTS).flatmap(lambda fault: _sensor_fault(fault, boards))
    return st.builds(kind, **drawn)


def _sensor_fault(fault: sensors.FaultKind, boards: int) -> st.SearchStrategy[SensorFault]:
    fields = annotated_fields(SensorFault)
    amounts = [
        amount for amount in (0.0, 0.25, 1.0, 30.0) if sensors.amount_trouble(fault, amount) is None
    ]
    return st.builds(
        SensorFault,
        of_type(fields["board"], boards),
        of_type(fields["sensor"]),
        st.just(fault),
        st.sampled_from(amounts),
        of_type(fields["ticks"]),
    )


ALL: st.SearchStrategy[Event] = st.one_of(*map(of_kind, EVENTS.values()))
BOARD_COMMANDS: st.SearchStrategy[BoardCommand] = st.one_of(
    st.builds(LinkOrder, st.integers(ANY, 20), st.builds(LinkParameters, **PARAMETERS)),
    st.builds(ReferenceOrder, st.floats(-RAD_MAX, RAD_MAX)),
)
