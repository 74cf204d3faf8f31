"""How a board asks to be let in, and what it makes of the answer, or of there being none.

Rule 1: asking again is harmless, so a board asks as often as it has something new to tell.
Rule 2: a plant that does not answer is not there, or its end of the cable still holds a connection
        that has died, and then it refuses this board's next ones. Nobody can tell from here, so
        after a while without an answer the session is to be opened anew: a new one is let in.

No clock: whoever drives this says what time it is.
"""

from module_agent.firmware.config import BoardConfig
from protocol.process.exit_codes import refused
from protocol.robot.scenario import Scenario
from protocol.wire.enrolment import (
    EnrolmentReply,
    EnrolmentRequest,
    EnrolmentVerdict,
    decode_reply,
    encode_enrolment,
)
from protocol.wire.frames import VERSION

UNANSWERED_S = 2.0
UNANSWERED_S_MAX = 60.0
"""So long is waited for an answer; twice as long each time, for the plant may not be started."""
PAUSE_S = 1.0
"""Who has not asked for so long begins to wait anew: it had other things to do, or was stopped."""


class FinishedError(Exception):
    """This board's part is over; says how, as an exit code and a line for the user."""

    def __init__(self, code: int, line: str) -> None:
        super().__init__(line)
        self.code = code


class UnansweredError(Exception):
    """The plant has not answered for long: time for another session."""


class Enrolling:
    """One board's requests to be let in."""

    def __init__(self, config: BoardConfig, scenario: Scenario, *, rig: str) -> None:
        self.config = config
        self.scenario = scenario
        self.rig = rig
        self.former_run = 0
        """The last run that this board took part in."""
        self._unanswered_since_s: float | None = None
        self._asked_s = 0.0
        self._patience_s = UNANSWERED_S

    def request(self, incarnation: int, *, boot: int, links_up: list[bool], now_s: float) -> bytes:
        """What to ask. Raises `UnansweredError` if there has been no answer for too long."""
        paused, self._asked_s = now_s - self._asked_s > PAUSE_S, now_s
        if self._unanswered_since_s is None or paused:
            self._unanswered_since_s = now_s
        elif now_s - self._unanswered_since_s > self._patience_s:
            self._unanswered_since_s = None
            self._patience_s = min(2.0 * self._patience_s, UNANSWERED_S_MAX)
            raise UnansweredError
        link = self.config.link
        request = EnrolmentRequest(
            version=VERSION,
            rig=self.rig,
            joint=self.config.joint,
            incarnation=incarnation,
            scenario_digest=self.scenario.digest,
            boot=boot,
            links_up=sum(up << n for n, up in enumerate(links_up)),
            former_run=self.former_run,
            mass_kg=link.mass_kg,
            length_m=link.length_m,
            com_m=link.com_m,
            inertia_kg_m2=link.inertia_kg_m2,
        )
        return encode_enrolment(request)

    def answer(self, payload: bytes) -> EnrolmentReply:
        """Read an answer. Raises `ProtocolError`, or `FinishedError` if it is a refusal."""
        answer = decode_reply(payload)
        if answer.verdict != EnrolmentVerdict.ACCEPTED:
            raise FinishedError(refused(answer.verdict), f"refused: {answer.reason}")
        self._unanswered_since_s, self._patience_s = None, UNANSWERED_S
        return answer
