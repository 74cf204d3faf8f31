"""The channels of `run.mcap`, from the schemas that it carries."""

from deploy.generated.markdown import table
from deploy.recording.mcap.messages import channels as channels_of

JOINTS = ["knee", "hip"]
"""Stand for any two neighbours; only the channels of the first are listed."""


def channels() -> str:
    """Give every channel of a run in lockstep, and what differs in realtime."""
    lockstep = channels_of(JOINTS)
    realtime = channels_of(JOINTS, in_realtime=True)
    both = {topic for topic in lockstep if realtime.get(topic) is lockstep[topic]}
    found = [(topic, "" if topic in both else "lockstep", lockstep[topic]) for topic in lockstep]
    found += [(topic, "realtime", realtime[topic]) for topic in realtime if topic not in both]
    rows = [
        (f"`{topic}`", mode, kind.about, ", ".join(f"`{field}`" for field in kind.fields))
        for topic, mode, kind in found
        if not topic.startswith(f"/{JOINTS[1]}/")
    ]
    return table(("channel", "mode", "what its messages say", "fields"), rows)
