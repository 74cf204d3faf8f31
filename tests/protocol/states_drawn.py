"""`python -m tests.protocol.states_drawn`: the firmware's states, drawn from their table."""

from collections.abc import Iterator

from protocol.robot.states import DRIVING, TRANSITIONS, FaultCode, State, Transition

GROUP = "driving"


def table() -> str:
    """Every transition, its number being that of its arrow."""
    rows = [
        f"| {number} | {', '.join(map(_name, row.before))} | {_name(row.after)} | {row.cause} |"
        for number, row in enumerate(TRANSITIONS, 1)
    ]
    return "\n".join(["| # | from | to | when |", "|---|---|---|---|", *rows])


def diagram() -> str:
    """A Mermaid state diagram; what all driving states have in common is drawn once."""
    within = [line for arrow in _arrows() if (line := _drawn(arrow, inside=True))]
    around = [line for arrow in _arrows() if (line := _drawn(arrow, inside=False))]
    return "\n".join(
        [
            "stateDiagram-v2",
            "    [*] --> boot",
            f"    state {GROUP} {{",
            *(f"        {line}" for line in dict.fromkeys(within)),
            "    }",
            *(f"    {line}" for line in dict.fromkeys(around)),
        ]
    )


def fault_codes() -> str:
    rows = [f"| {code} | {code.title} |" for code in FaultCode]
    return "\n".join(["| code | what has failed |", "|---|---|", *rows])


Arrow = tuple[int, State, State]


def _arrows() -> Iterator[Arrow]:
    for number, row in enumerate(TRANSITIONS, 1):
        for before in row.before:
            yield number, before, row.after


def _drawn(arrow: Arrow, *, inside: bool) -> str:
    """One arrow of the diagram; none, where it lies on the other side of the group's border."""
    number, before, after = arrow
    both = before in DRIVING and after in DRIVING
    if both is not inside:
        return ""
    if both:
        return f"{_name(before)} --> {_name(after)} : {number}"
    if before in DRIVING:
        assert set(DRIVING) <= set(_row(number).before), "from any of them, or not from the group"
        return f"{GROUP} --> {_name(after)} : {number}"
    if after in DRIVING:
        numbers = [n for n, b, a in _arrows() if b is before and a in DRIVING]
        assert len(numbers) == len(DRIVING), "to any of them, or not to the group"
        return f"{_name(before)} --> {GROUP} : {numbers[0]} to {numbers[-1]}"
    return f"{_name(before)} --> {_name(after)} : {number}"


def _row(number: int) -> Transition:
    return TRANSITIONS[number - 1]


def _name(state: State) -> str:
    return state.name.lower()


if __name__ == "__main__":
    print(table(), f"```mermaid\n{diagram()}\n```", fault_codes(), sep="\n\n")
