"""Compiling: the control loop in C, by mypyc (`make compiled`).

What is compiled is what runs in every tick, but for frames, which are made from their annotations,
`LinkModel`, which a replay extends, and whatever takes values of any type.
"""

from mypyc.build import mypycify
from setuptools import setup

from protocol.compiled import compiled

MODULES = {
    "protocol": ("chance", "clocks"),
    "module_agent": (
        "board", "body_view", "consensus", "counts", "election", "elector", "hearing",
        "kinematics", "lateness", "mailbox", "plausibility", "post", "realtime", "realtime_board",
        "realtime_cycle", "realtime_election", "realtime_sensing", "realtime_view", "runtime",
        "sensing", "servo", "speech",
    ),
    "plant_server": (
        "actuators", "answers", "articulated", "attendance", "body", "free_running", "lockstep",
        "post", "pushes", "realtime", "roster", "runtime", "sensor_faults", "sensors",
        "telemetry",
    ),
}  # fmt: skip
SHARED = "protocol.control_loop"
"""The library that all of them share."""
BY_THE_BOOK = "-ffp-contract=off"
"""Rounds after each operation, as Python does, also where the processor could do two at once."""


def main() -> None:
    """Compile, and leave each library beside its source."""
    paths = [f"{package}/{name}.py" for package, names in MODULES.items() for name in names]
    extensions = mypycify(paths, group_name=SHARED)
    for extension in extensions:
        extension.extra_compile_args.append(BY_THE_BOOK)
    setup(
        name="control-loop",
        script_args=["--quiet", "build_ext", "--inplace"],
        ext_modules=extensions,
        packages=[],
    )
    for _, library in compiled():
        library.touch()  # Also what need not be made anew is that of today's source.


if __name__ == "__main__":
    main()
