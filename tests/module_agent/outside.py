"""Controllers from outside for tests, written into files as a user would."""

from hashlib import sha256
from pathlib import Path

from module_agent.firmware.config import Source

SERVO = """
class Mine:
    def __init__(self, config):
        pass

    def torque_nm(self, seen):
        {body}
"""
ELECTION = """
from module_agent.firmware.controller import Candidate, Vote

class Mine:
    def __init__(self, config):
        self.board = config.index

    def vote(self, now):
        {body}
"""


def source(path: Path, name: str = "Mine") -> Source:
    """A class in a file that is there."""
    return Source(f"{path.stem}:{name}", str(path), sha256(path.read_bytes()).hexdigest())


def written(path: Path, text: str) -> Source:
    path.write_text(text, encoding="utf-8")
    return source(path)


def servo(folder: Path, body: str) -> Source:
    """A servo whose `torque_nm` has this body."""
    return written(folder / "my_servo.py", SERVO.format(body=body))


def election(folder: Path, body: str) -> Source:
    """An election whose `vote` has this body."""
    return written(folder / "my_election.py", ELECTION.format(body=body))
