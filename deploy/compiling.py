"""Compiling: the control loop in C, by mypyc (`make compiled`).

What is compiled is what runs in every tick, but for frames, which are made from their annotations,
`LinkModel`, which a replay extends, and whatever takes values of any type.
"""

from mypyc.build import mypycify
from setuptools import setup

from protocol.process.compiled import compiled

MODULES = {
    "protocol/robot": ("chance", "clocks"),
    "module_agent/firmware": (
        "board", "body_view", "consensus", "election", "elector", "frame_writer",
        "hearing", "kinematics", "lateness", "plausibility", "sensing", "servo",
    ),
    "module_agent/firmware/own_time": ("board", "cycle", "mailbox", "translator"),
    "module_agent/process": ("lockstep", "membership", "network", "own_time"),
    "plant_server/body": ("articulated", "body", "disturbances"),
    "plant_server/hardware": ("actuators", "sensor_faults", "sensors"),
    "plant_server/process": ("board_processes", "lockstep_loop", "network", "realtime_loop"),
    "plant_server/session": (
        "attendance", "free_running", "lockstep", "plant", "roster", "telemetry",
    ),
}  # fmt: skip
SHARED = "protocol.control_loop"
"""The library that all of them share."""
BY_THE_BOOK = "-ffp-contract=off"
"""Rounds after each operation, as Python does, also where the processor could do two at once."""


def main() -> None:
    """Compile, and leave each library beside its source."""
    paths = [f"{folder}/{name}.py" for folder, names in MODULES.items() for name in names]
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
