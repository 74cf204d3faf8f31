"""Names of the channels of `run.mcap`."""

SCENARIO, FACTS, PLANT_TICK, PACE = "/scenario", "/facts", "/plant/tick", "/plant/pace"
EPOCH, EVENT, TIMING = "/epoch", "/event", "/timing"
REFUSED, OUTCOME = "/refused", "/outcome"


def observation(joint: str) -> str:
    """Where a board's observations are."""
    return f"/{joint}/observation"


def torque(joint: str) -> str:
    """Where a board's answers are."""
    return f"/{joint}/torque"


def timing(joint: str) -> str:
    """Where the times are that a board told."""
    return f"/{joint}/timing"


def link(sender: str, receiver: str) -> str:
    """Where one board's frames for another are."""
    return f"/{sender}/link/{receiver}"


def turn(joint: str) -> str:
    """Where a board's turns are, in realtime."""
    return f"/{joint}/turn"


def last_word(joint: str) -> str:
    """Where the frames are that a board tells of neighbours that are gone."""
    return f"/{joint}/last_word"
