"""Key expressions. A board declares exact keys, never `*`: locality is a property of the wiring.

A chunk that starts with `@` is not matched by `**`, so a listener on `dec/**` hears data only.
"""

from protocol.wire.frames import VERSION, Report, report_name

ENROL = "dec/@enrol"
"""Outside version and rig: what does not fit must still be answered."""
_HERE = f"dec/v{VERSION}"
"""What the keys of this version begin with; another version hears none of them."""


def observation(rig: str, joint: str) -> str:
    """Plant to one board, each tick."""
    return f"{_HERE}/{rig}/plant/{joint}/observation"


def end(rig: str) -> str:
    """Plant to every board, once."""
    return f"{_HERE}/{rig}/plant/@end"


def control(rig: str) -> str:
    """Queries of a terminal: status and commands."""
    return f"{_HERE}/{rig}/plant/@ctl"


def stalled(rig: str, joint: str) -> str:
    """One board to the plant: which neighbour's frame it has been waiting for."""
    return f"{_HERE}/{rig}/{joint}/@stalled"


def fault(rig: str, joint: str) -> str:
    """One board to the plant: what has failed, in the tick in which it did."""
    return f"{_HERE}/{rig}/{joint}/fault"


def trace(rig: str, joint: str) -> str:
    """One board to the plant, now and then, in realtime: what it lived through."""
    return f"{_HERE}/{rig}/{joint}/@trace"


def torque(rig: str, joint: str) -> str:
    """One board to the plant, each tick."""
    return f"{_HERE}/{rig}/{joint}/torque"


def report(rig: str, joint: str, kind: type[Report]) -> str:
    """One board to a plant that records, now and then: what is for the recording alone."""
    return f"{_HERE}/{rig}/{joint}/{report_name(kind)}"


def link(rig: str, sender: str, receiver: str) -> str:
    """One board to one mechanical neighbour, each tick."""
    return f"{_HERE}/{rig}/{sender}/link/{receiver}"


def plant_alive(rig: str) -> str:
    """Token of the plant: it stands while the process lives."""
    return f"{_HERE}/{rig}/plant/@alive"


def alive(rig: str, joint: str, boot: int) -> str:
    """A token has no payload, so which boot of the board it stands for is in its key."""
    return f"{_HERE}/{rig}/{joint}/@alive/{boot:016x}"


def any_alive(rig: str) -> str:
    """What the plant listens on: the token of every board of its rig."""
    return f"{_HERE}/{rig}/*/@alive/*"


def joint_of(key: str) -> str:
    """The joint that a `stalled`, `fault` or `trace` key names."""
    return key.split("/")[-2]


def board_of(alive_key: str) -> tuple[str, int]:
    """The joint and the boot that an `alive` key names."""
    *_, joint, _alive, boot = alive_key.split("/")
    try:
        return joint, int(boot, 16)
    except ValueError:
        return joint, 0  # A stranger's token; no board has this boot.
