"""One epoch of three boards, to be read: `election*.txt` beside this file.

Made from what the boards tell the plant: each torque frame holds the gossip of its tick, and a
receipt for each frame that was used. `pytest tests/transcripts --rewrite-transcripts` writes them
anew; whoever changes the election reads in the difference what has changed.
"""

from collections.abc import Iterator
from math import degrees
from pathlib import Path

import pytest

from deploy.launch.twin import run_twin
from deploy.scenario_file.load import load
from protocol.wire.frames import TorqueFrame, decode
from protocol.wire.wiring import neighbours

JOINTS = ("ankle", "knee", "hip")
LEANING = ["board.0.initial_deg=4", "board.1.initial_deg=4", "board.2.initial_deg=8"]
"""Leaning forward, the trunk most: the hip is the most urgent, the ankle comes next."""
BEGINS, ROUNDS = 0, 2
LOST = """
[[event]]
at_s = 0.002
do = "cut"
link = "knee-ankle"
one_way = true
duration_s = 0.001
"""
CASES = {
    "election.txt": ("Every frame arrives.", ""),
    "election_one_frame_lost.txt": ("The knee's last frame to the ankle is lost.", LOST),
}


def played(events: str, folder: Path) -> list[list[TorqueFrame]]:
    """Ticks of that epoch, from its first to the one in which y is latched."""
    source = folder / "scenario.toml"
    text = f'extends = "paper"\n[run]\nduration_s = 0.01\n{events}'
    source.write_text(text, encoding="utf-8")
    records, _ = run_twin(load(str(source), LEANING))
    return [
        [decode(TorqueFrame, answer) for answer in record.answers]
        for record in records
        if BEGINS <= record.tick <= BEGINS + ROUNDS
    ]


def best(frame: TorqueFrame) -> str:
    return f"{JOINTS[frame.candidate]} {degrees(frame.urgency):.1f}°"


def hears(board: int, frame: TorqueFrame, before: list[TorqueFrame]) -> str:
    """What a board used of its neighbours' frames of the tick before, by its own receipts."""
    told = [
        f"{JOINTS[near]}: {best(before[near])}"
        if use.heard_mask & 1
        else f"{JOINTS[near]}: nothing"
        for near, use in zip(neighbours(board, len(JOINTS)), frame.links, strict=True)
    ]
    return ", ".join(told)


def transcript(title: str, ticks: list[list[TorqueFrame]]) -> Iterator[str]:
    yield f"One epoch of three boards, {ROUNDS} rounds. {title}"
    yield "w: how far a board is from its reference. Who has the largest may move: y = 1."
    yield "In each round a board says whose w is the largest that it knows of, and how large it is;"
    yield "its neighbours hear that in the next tick. After the last round each decides its y."
    for number, frames in enumerate(ticks):
        tick = BEGINS + number
        yield ""
        if number == 0:
            yield f"tick {tick}   the epoch begins: each board says its own w"
            for board, frame in enumerate(frames):
                assert frame.candidate == board
                yield f"  {JOINTS[board]:6} says {best(frame)}"
            continue
        what = "round {0}, the last: each board decides" if number == ROUNDS else "round {0}"
        yield f"tick {tick}   {what.format(number)}"
        for board, frame in enumerate(frames):
            assert frame.round == number
            yield f"  {JOINTS[board]:6} hears {hears(board, frame, ticks[number - 1])}"
            y = f", so y = {frame.enabled}" if number == ROUNDS else ""
            yield f"  {'':6} knows {best(frame)}{y}"
    enabled = [JOINTS[board] for board, frame in enumerate(ticks[-1]) if frame.enabled]
    yield ""
    yield f"May move in this epoch: {' and '.join(enabled) or 'nobody'}."


@pytest.mark.parametrize("name", CASES)
def test_an_epoch_goes_as_its_transcript_says(
    name: str, tmp_path: Path, pytestconfig: pytest.Config
) -> None:
    title, events = CASES[name]
    text = "\n".join(transcript(title, played(events, tmp_path))) + "\n"
    kept = Path(__file__).with_name(name)
    if pytestconfig.getoption("--rewrite-transcripts"):
        kept.write_text(text, encoding="utf-8")
    assert text == kept.read_text(encoding="utf-8")
