"""Names of the channels of `run.mcap`."""

from protocol.wire.frames import Report, report_name

SCENARIO, FACTS, PLANT_TICK, PACE = "/scenario", "/facts", "/plant/tick", "/plant/pace"
EPOCH, EVENT, TIMING = "/epoch", "/event", "/timing"
REFUSED, OUTCOME = "/refused", "/outcome"


def observation(joint: str) -> str:
    """Where a board's observations are."""
    return f"/{joint}/observation"


def torque(joint: str) -> str:
    """Where a board's answers are."""
    return f"/{joint}/torque"


def report(joint: str, kind: type[Report]) -> str:
    """Where what a board told for the recording is."""
    return f"/{joint}/{report_name(kind)}"


def link(sender: str, receiver: str) -> str:
    """Where one board's frames for another are."""
    return f"/{sender}/link/{receiver}"


def turn(joint: str) -> str:
    """Where a board's turns are, in realtime."""
    return f"/{joint}/turn"


def last_word(joint: str) -> str:
    """Where the frames are that a board tells of neighbours that are gone."""
    return f"/{joint}/last_word"
