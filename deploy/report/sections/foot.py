"""The foot in a report: where the pressure under it was, and how far from an edge of the sole."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from deploy.outcome.drawing import INK
from deploy.outcome.figures import DOTS_PER_INCH, WIDTH_IN
from deploy.outcome.foot_margin import cop_m
from deploy.report.page import Block
from deploy.report.pictures import Pictures
from deploy.report.runs import ReportedRun
from deploy.report.sections.run_table import NONE, run_table

HEIGHT_IN = 1.7
SOLE = "#ebebe7"
BEYOND = 0.2
"""So much more than the sole is shown, of its length."""


def foot(runs: Sequence[ReportedRun], pictures: Pictures) -> list[Block]:
    """The centre of pressure over time, and its margin; nothing of bodies without a foot."""
    standing = [run for run in runs if run.summary["foot"] is not None]
    if not standing:
        return []
    rows = []
    for run in standing:
        found = run.summary["foot"]
        least_m = found["margin_min_m"]
        least = NONE if least_m is None else f"{1e3 * least_m:.1f}"
        rows.append((run, ["the sole", least, f"{found['tipping_ticks']:,}"]))
    return [
        *pictures.each(
            "foot",
            standing,
            draw_foot,
            title="Pressure under the foot",
            reading="The line is the centre of pressure, forward of the ankle; the pale band is the"
            " sole. At an edge the foot begins to tip, and the ankle gets no more torque: such"
            " ticks are marked.",
            wide=True,
        ),
        run_table(
            runs,
            "Margin of the foot",
            "How close the centre of pressure came to an edge of the sole, 0 where the foot tipped,"
            " and in how many ticks the ankle was asked for more than the sole can bear.",
            ["", "least margin (mm)", "ticks tipping"],
            rows,
        ),
    ]


def draw_foot(run: ReportedRun) -> Figure:
    """Draw the centre of pressure of one run over its time, within the sole."""
    trajectory = run.recording.trajectory
    sole = trajectory.scenario.boards[0].foot
    assert sole is not None, "only runs with a foot are drawn"
    ahead_mm, behind_mm = 1e3 * sole.ahead_m, -1e3 * sole.behind_m
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DOTS_PER_INCH, layout="constrained")
    axes = figure.subplots()
    axes.axhspan(behind_mm, ahead_mm, color=SOLE, linewidth=0)
    times_s, pressure_mm = trajectory.times_s[:-1], 1e3 * cop_m(trajectory)
    axes.plot(times_s, np.clip(pressure_mm, behind_mm, ahead_mm), color=INK, linewidth=0.7)
    tipping = (pressure_mm >= ahead_mm) | (pressure_mm <= behind_mm)
    axes.plot(
        times_s[tipping],
        np.clip(pressure_mm[tipping], behind_mm, ahead_mm),
        "|",
        color="#c1272d",
        markersize=5,
    )
    room_mm = BEYOND * (ahead_mm - behind_mm)
    axes.set_ylim(behind_mm - room_mm, ahead_mm + room_mm)
    axes.set_xlim(0.0, max(trajectory.ticks, 1) * trajectory.tick_s)
    axes.set_xlabel("Time (s)")
    axes.set_ylabel("Forward (mm)")
    return figure
