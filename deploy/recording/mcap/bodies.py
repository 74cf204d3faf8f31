"""Records as the bodies of messages, and back: `schema` says what each field means.

Rule: back and forth gives the same record, bytes of frames included.
"""

import json
from collections.abc import Iterator, Sequence
from operator import index
from typing import Any

from deploy.recording.epochs import Epochs
from deploy.recording.fates import FrameOutcome
from plant_server.session.record import Outcome, TickRecord, TickWallTimes, UndrivenJoint
from plant_server.spool.spool import recorded_scenario
from protocol.robot.canonical_json import canonical_json
from protocol.robot.events import EVENTS, Event, event_of, values_of
from protocol.robot.scenario import Scenario, canonical
from protocol.robot.states import COUNTERS
from protocol.wire.fields import fields
from protocol.wire.frames import (
    LinkFrame,
    LinkUse,
    Observation,
    Report,
    TorqueFrame,
    decode,
    encode,
)

Body = dict[str, Any]
WHOLE_END = 2**63


def of_scenario(scenario: Scenario) -> Body:
    """What was run."""
    run = scenario.run
    return {
        "name": scenario.name,
        "seed": run.seed,
        "joints": scenario.joints,
        "tick_s": run.tick_s,
        "digest": scenario.digest.hex(),
        "resolved": canonical(scenario).decode(),
    }


def to_scenario(body: Body) -> Scenario:
    """What was run. Raises ValueError."""
    return recorded_scenario(body["resolved"].encode())


def of_facts(facts: dict[str, Any]) -> Body:
    """Facts of the run; those of older recordings may be missing."""
    told = {name: str(facts.get(name, "")) for name in ("mode", "started", "fingerprint")}
    return {**told, "all": canonical_json(facts).decode()}


def to_facts(body: Body) -> dict[str, Any]:
    """Facts of the run."""
    facts: dict[str, Any] = json.loads(body["all"])
    return facts


def of_tick(record: TickRecord) -> Body:
    """The body in one tick."""
    return {
        "tick": record.tick,
        "angles_rad": record.angles_rad,
        "rates_rad_s": record.rates_rad_s,
        "torques_nm": record.torques_nm,
    }


def to_tick(body: Body, answers: Sequence[bytes], events: Sequence[Event]) -> TickRecord:
    """A record, with what was said on the other channels in the same tick."""
    return TickRecord(
        body["tick"],
        _floats(body["angles_rad"]),
        _floats(body["rates_rad_s"]),
        _floats(body["torques_nm"]),
        tuple(answers),
        tuple(events),
    )


def of_observation(observation: Observation) -> Body:
    """What a board was told."""
    body = observation._asdict()
    body |= body.pop("readings")._asdict()
    body["command_hex"] = body.pop("command").hex()
    body["neighbours"] = [neighbour._asdict() for neighbour in observation.neighbours]
    return body


def of_torque(frame: TorqueFrame, payload: bytes) -> Body:
    """What a board answered."""
    body = frame._asdict()
    body["counter"] = COUNTERS[frame.counter]
    body["links"] = [use._asdict() for use in frame.links]
    if encode(frame) != payload:  # Foreign, but right: integers have several encodings.
        body["frame_hex"] = payload.hex()
    return body


def to_torque(body: Body) -> bytes:
    """The frame, as it was on the wire."""
    if "frame_hex" in body:
        return bytes.fromhex(body["frame_hex"])
    values = {name: body[name] for name in TorqueFrame._fields}
    for name in ("torque_nm", "controlled_rad", "urgency"):
        values[name] = float(values[name])
    values["counter"] = COUNTERS.index(body["counter"])
    values["links"] = tuple(LinkUse(**use) for use in body["links"])
    return encode(TorqueFrame(**values))


def of_link(settled: FrameOutcome, sent_crc: int | None, payload: bytes | None) -> Body:
    """What was said to a neighbour, as far as it is known, and what became of it.

    Without a receipt of its sender, `sent_crc`, it is not known to have been said.
    """
    about = {
        "tick": settled.said_tick,
        "fate": settled.fate.name.lower(),
        "heard_tick": settled.heard_tick,
        "frame_bytes": 0 if payload is None else len(payload),
    }
    if sent_crc is not None:
        about["sent_crc"] = sent_crc
    if payload is None:
        return about
    body = decode(LinkFrame, payload)._asdict()
    body["echo_tick"] = body.pop("heard_tick")
    return {**body, **about}


def of_epochs(found: Epochs | None, joints: Sequence[str]) -> Iterator[Body]:
    """Elections, in their order."""
    if found is None:
        return
    for i, members in enumerate(found.members):
        yield {
            "epoch": int(found.number[i]),
            "tick": int(found.latch_tick[i]),
            "began_tick": int(found.first_tick[i]),
            "members": [joint for joint, member in zip(joints, members, strict=True) if member],
            "w_rad": found.w_rad[i][members].tolist(),
            "rounds_to_agreement": int(found.agreed_after[i]),
            "known_after_rounds": found.known_after[i][members].tolist(),
            "y": found.enabled[i][members].astype(int).tolist(),
        }


def of_event(tick: int, event: Event) -> Body:
    """What happened to the robot."""
    what, *values = values_of(event)
    return {"tick": tick, "what": what, **dict(zip(event.__struct_fields__, values, strict=True))}


def to_event(body: Body) -> Event:
    """What happened to the robot. Raises ValueError."""
    what = body["what"]
    fields = EVENTS[what].__struct_fields__ if what in EVENTS else ()
    return event_of([what, *(body[name] for name in fields)], strict=False)


def of_walls(tick: int, walls: TickWallTimes) -> Body:
    """When the plant did what."""
    return {"tick": tick, **walls._asdict()}


def to_walls(body: Body) -> TickWallTimes:
    """When the plant did what."""
    return TickWallTimes(
        _whole(body["opened_ns"]),
        tuple(map(_whole, body["answered_ns"])),
        _whole(body["closed_ns"]),
    )


def of_report(report: Report) -> Body:
    """What a board told for the recording."""
    return {
        name: [entry._asdict() for entry in value] if isinstance(value, tuple) else value
        for name, value in report._asdict().items()
    }


def to_report(kind: type[Report], body: Body) -> Report:
    """What a board told for the recording."""
    report: Report = _mirror(kind, body)
    return report


def _mirror(kind: Any, body: Body) -> Any:
    """A message of the wire, or an entry of one, from what mirrors it."""
    values: list[Any] = []
    for of in fields(kind):
        value = body[of.name]
        if of.repeats:
            values.append(tuple(_mirror(of.type, entry) for entry in value))
        else:
            values.append(_whole(value) if of.type is int else of.type(value))
    return kind(*values)


def of_outcome(outcome: Outcome) -> Body:
    """How the run ended."""
    return {
        **outcome._asdict(),
        "undriven": [
            {**joint._asdict(), "has_board": int(joint.has_board)} for joint in outcome.undriven
        ],
    }


def of_refused(
    by_link: dict[tuple[str, str], dict[str, int]], by_network: dict[str, dict[str, int]]
) -> Body:
    """What boards refused, by reason: by sender and receiver, and by joint."""
    return {
        "by_link": [
            {"sender": sender, "receiver": receiver, "reason": reason, "frames": frames}
            for (sender, receiver), reasons in by_link.items()
            for reason, frames in reasons.items()
            if frames
        ],
        "by_network": [
            {"joint": joint, "reason": reason, "frames": frames}
            for joint, reasons in by_network.items()
            for reason, frames in reasons.items()
        ],
    }


def to_outcome(body: Body) -> Outcome:
    """How the run ended."""
    undriven = tuple(
        UndrivenJoint(**{**joint, "has_board": bool(joint["has_board"])})
        for joint in body["undriven"]
    )
    return Outcome(
        body["tick"],
        _floats(body["angles_rad"]),
        _floats(body["rates_rad_s"]),
        body["ending"],
        float(body["wall_s"]),
        undriven,
    )


def _whole(number: int) -> int:
    """A number that is one, and of 64 bits; raises TypeError or ValueError."""
    if not -WHOLE_END <= index(number) < WHOLE_END:
        raise ValueError(f"{number} is too large")
    return number


def _floats(numbers: Sequence[float | str]) -> tuple[float, ...]:
    """Numbers of a message; one that is none came as a string."""
    return tuple(map(float, numbers))
