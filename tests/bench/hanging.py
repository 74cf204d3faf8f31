"""A hanging chain of any length, with local joint servos: the body on which growth is measured.

A standing chain of hundreds of links would fall, whoever controls it. A hanging one swings, and its
boards have the same to do: every board hears its neighbours, passes the body on, elects, and drives
its own joint. An election takes as many rounds as there are hops, and the next follows at once, so
that every board is electing in every tick, however many there are.
"""

import math

from protocol.robot.hardware import IDEAL, STEADY, Link, PassiveElement, ServoGains, UnattendedJoint
from protocol.robot.scenario import (
    BoardSettings,
    Controls,
    ElectionSettings,
    RigSettings,
    RunSettings,
    Scenario,
)
from protocol.robot.sensors import EXACT

LUMPED_DELAY_TICKS = 10
LENGTH_M = 0.1
MASS_KG = 1.0
BEND_RAD = 0.2
"""How far links lean to one side and the other at the start, so that everything moves."""
NEVER_FALLEN = -2.0
"""A hanging body is below any share of its upright height."""


def hanging(boards: int, *, ticks: int = 1_000_000, seed: int = 1) -> Scenario:
    """Resolve the scenario. A file could not say it: to a user, a body that hangs has fallen."""
    hops = boards - 1
    return Scenario(
        name="hanging",
        description=f"A hanging chain of {boards} links with local joint servos.",
        run=RunSettings(seed=seed, ticks=ticks, tick_s=1e-3, substeps=1, fallen_below=NEVER_FALLEN),
        rig=RigSettings(name="hanging", host="127.0.0.1", base_port=17_700),
        election=ElectionSettings(
            enabled=True,
            period_ticks=max(hops, 1) + 1,
            rounds=max(hops, 1),
            disabled_holds="controlled-variable",
            incomplete="each-side",
            rule=None,
        ),
        link_faults=(),
        events=(),
        boards=tuple(_board(board, hops) for board in range(boards)),
        link_names=tuple(f"link_{board}" for board in range(boards)),
    )


def _board(board: int, hops: int) -> BoardSettings:
    return BoardSettings(
        joint=f"joint_{board}",
        controls=Controls.JOINT_ANGLE,
        controller=None,
        reference_rad=0.0,
        initial_rad=math.pi + BEND_RAD * math.sin(float(board)),
        lumped_delay_ticks=max(LUMPED_DELAY_TICKS, hops - board),
        imu=board == hops,
        force_plate=board == 0,
        servo=ServoGains(
            kp_nm_rad=0.05,
            kd_nm_s_rad=0.001,
            ki_nm_rad_s=0.0,
            g_servo=1.0,
            gravity_weight=0.0,
            torque_limit_nm=10.0,
        ),
        unattended=UnattendedJoint("limp", 0.0, 0.0),
        link=Link(
            mass_kg=MASS_KG,
            length_m=LENGTH_M,
            com_m=LENGTH_M / 2.0,
            inertia_kg_m2=MASS_KG * LENGTH_M**2 / 12.0,
        ),
        clock=STEADY,
        sensors=EXACT,
        actuator=IDEAL,
        passive=PassiveElement(0.0, 0.0, 0.0),
        foot=None,
    )
