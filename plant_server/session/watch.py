"""What the plant's process notices beside the run: boards that hang, and storms of frames.

Rule: all of this depends on the clock of the machine, so none of it is recorded, and it decides
nothing. It is for whoever asks how the robot is.
"""

from collections import Counter
from collections.abc import Callable

from plant_server.session.plant import Plant
from protocol.wire.frames import Reason
from protocol.wire.storms import Storm, Storms

ENROLMENT_REQUESTS = "enrolment requests"


class PlantWatch:
    """Of one plant process."""

    def __init__(self, joints: list[str]) -> None:
        self.joints = joints
        self.enrolled: set[int] = set()
        """Boards that the plant has let in, whether they take part already or not."""
        self.stuck = [0] * len(joints)
        """How often each board's watchdog has found it hanging."""
        self.storms = Storms()
        self._unreadable: dict[str, Counter[Reason]] = {ENROLMENT_REQUESTS: Counter()}

    def count(self, origin: str, reason: Reason) -> None:
        """Count a frame that could not be used and belongs to no tick."""
        self._unreadable.setdefault(origin, Counter())[reason] += 1

    def look(self, now_s: float, plant: Plant) -> list[Storm]:
        """Look for storms; those that are worth a line."""
        telemetry, refused = plant.telemetry, dict[str, dict[Reason, int]]()
        for board, joint in enumerate(self.joints):
            counters = telemetry.counters(board)
            refused[f"frames of {joint}"] = telemetry.refused[board]
            refused[f"frames to {joint}"] = {
                reason: getattr(counters, f"refused_{reason}") for reason in Reason
            }
        return self.storms.look(now_s, plant.tick, {**refused, **self._unreadable})

    def tell_storms(self, now_s: float, plant: Plant, tell: Callable[[str], None]) -> None:
        """Look for storms, and tell those."""
        for storm in self.look(now_s, plant):
            tell(str(storm))
