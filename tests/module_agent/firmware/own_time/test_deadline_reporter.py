"""Strain: missed deadlines are told seldom, with their number and cause."""

from module_agent.firmware.own_time.deadline_reporter import DeadlineReporter, TurnAccount

PERIOD_NS = 2_000_000
SECOND_NS = 1_000_000_000
SILENT_NS = 50_000_000


def told(
    seconds: int, missed: int, *, computing_ns: int = 200_000, silent_ns: int = SILENT_NS
) -> list[tuple[int, str]]:
    """A board that misses so many deadlines in each turn of 10 ms; when it complains, and how."""
    strain, lines = DeadlineReporter(period_ns=PERIOD_NS, silent_ns_max=SILENT_NS), []
    for n in range(seconds * 100):
        now_ns = n * SECOND_NS // 100
        line = strain.turned(TurnAccount(now_ns, missed, 4_100_000, computing_ns, silent_ns))
        if line is not None:
            lines.append((now_ns // SECOND_NS, line))
    return lines


def test_a_board_that_keeps_its_deadlines_says_nothing() -> None:
    assert told(60, 0) == []


def test_lines_are_ever_further_apart() -> None:
    assert [second for second, _ in told(30, 1)] == [1, 3, 7, 15, 23]


def test_a_line_says_how_many_how_late_and_why() -> None:
    (_, line), *_ = told(2, 1)
    assert line == "101 deadlines missed in the last 1 s, worst 4.1 ms late: the host is busy"


def test_a_turn_that_computes_for_too_long_has_itself_to_blame() -> None:
    (_, line), *_ = told(2, 1, computing_ns=2_300_000)
    assert line.endswith(
        "a turn takes up to 2.3 ms of computing, its period is 2 ms; choose a lower rate_hz"
    )


def test_a_plant_that_is_silent_is_told_of_too() -> None:
    (_, line), *_ = told(2, 0, silent_ns=SILENT_NS + 30_000_000)
    assert line == (
        "no observation for up to 80 ms, and no torque meanwhile:"
        " the plant is held up, or not to be reached"
    )
    (_, both), *_ = told(2, 1, silent_ns=SILENT_NS + 1)
    assert "deadlines missed" in both
    assert "no observation" in both


def test_after_a_quiet_while_it_speaks_at_once_again() -> None:
    strain, lines = DeadlineReporter(period_ns=PERIOD_NS, silent_ns_max=SILENT_NS), []
    for n in range(6000):
        bad = n < 1500 or n >= 4500
        line = strain.turned(TurnAccount(n * SECOND_NS // 100, int(bad), 3_000_000, 100_000, 0))
        if line is not None:
            lines.append(n // 100)
    assert lines[:4] == [1, 3, 7, 15]
    assert 45 <= lines[4] <= 46
