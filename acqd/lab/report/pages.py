"""The HTML reports of `acqd lab trajectories`, `execute` and `campaign`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from acqd.arrays import Floats
from acqd.lab.campaign.trajectory_set import TrajectorySet
from acqd.lab.cell import MOTION, Cell
from acqd.lab.motion.controller import RATE, Controller
from acqd.lab.motion.trajectory import Trajectory
from acqd.lab.report import figures
from acqd.lab.session import SessionTruth, windows_within
from acqd.report import Page


def trajectories_report(cell: Cell, trajectories: TrajectorySet, folder: Path) -> Path:
    """Workspaces, points, blending, and two executions of one trajectory; figures also as PNG."""
    page = Page(f"Excitation trajectories of {cell.robot.title}", simulated=True)
    page.text(f"Scene {cell.scene.name}: {', '.join(box.name for box in cell.scene.box) or 'empty'}.")
    columns = ("trajectories", "points", "unreachable", "colliding")
    rows = [[space, *(tally[key] for key in columns)] for space, tally in trajectories.summary().items()]
    page.table(["space", "trajectories", "points", "rejected: unreachable", "rejected: colliding"], rows)
    if trajectories.limited:
        page.heading("Limited space (Algorithm 1)")
        figure = figures.limited_space(cell.arm, cell.scene, cell.cube(), trajectories.limited)
        page.figure(figure, "Cube, points and PTP paths (thesis Figure 5.1).", folder / "limited_space.png")
    if trajectories.all_space:
        page.heading("All space (Algorithm 2)")
        figure = figures.all_space(cell.arm, cell.scene, trajectories.all_space)
        page.figure(figure, "Collision boxes and poses (thesis Figure 5.2).", folder / "all_space.png")
    shown = (trajectories.limited or trajectories.all_space)[0]
    executed = [_executed(cell, shown, number) for number in (1, 2)]
    page.heading("Execution")
    figure = figures.blending(cell.arm, shown, executed[0][::20])
    page.figure(figure, "Blending cuts the corners (thesis Figure 5.3).", folder / "blending.png")
    figure = figures.two_executions([joint.name for joint in cell.robot.joint], executed, RATE)
    page.figure(figure, f"Two executions of {shown.name} (thesis Figure 5.4).", folder / "two_executions.png")
    path = folder / "report.html"
    page.write(path)
    return path


def _executed(cell: Cell, trajectory: Trajectory, number: int) -> Floats:
    controller = Controller(cell.robot, trajectory.waypoints[0])
    return controller.run(cell.planner.program(trajectory, cell.random(MOTION, number, 1))).q


def execution_report(cell: Cell, truth: SessionTruth, q: Floats, folder: Path) -> Path:
    """Power and joint angles of one execution, and its energy balance."""
    recording = truth.recordings[0]
    page = Page(f"{recording.name} on the virtual {cell.robot.title}", simulated=True)
    within = windows_within(recording.start_s, recording.seconds, truth.window_s)
    t = np.arange(within.start, within.stop) * truth.window_s - recording.start_s
    figure = Figure(figsize=(10, 7.5))
    power, error, angles = figure.subplots(3, 1, sharex=True, height_ratios=(3, 1, 3))
    power.plot(t, truth.metered[within], color="#2563eb", linewidth=1)
    power.set_ylabel("metered active power P [W]")
    error.plot(t, truth.metered[within] - truth.power[within], color="#d97706", linewidth=0.8)
    error.set_ylabel("metered minus\ntrue power [W]")
    for axis, joint in enumerate(cell.robot.joint):
        angles.plot(np.arange(0, len(q), 20) / RATE, np.degrees(q[::20, axis]), linewidth=0.9, label=joint.name)
    angles.set(xlabel="time [s]", ylabel="joint angle [°]")
    angles.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    for panel in (power, error, angles):
        panel.grid(alpha=0.3)
    figure.tight_layout()
    page.figure(figure, "Mains power and joint angles.", folder / "power.png")
    page.heading("Energy balance")
    dissipated = truth.energy["dissipated_J"]
    rows: list[list[object]] = [
        [name, joules] for name, joules in sorted(dissipated.items(), key=lambda item: -item[1])
    ]
    rows += [["increase of stored energy", truth.energy["stored_J"]]]
    rows += [["supplied by the mains", truth.energy["supplied_J"]]]
    page.table(["channel", "energy [J]"], rows)
    page.text(f"Balance error: {truth.energy['unaccounted_share']:.1e} of the supplied energy.")
    path = folder / "report.html"
    page.write(path)
    return path


def campaign_report(
    title: str, powers: dict[str, Floats], spaces: dict[str, dict[str, float]], window_s: float, folder: Path
) -> Path:
    """Distribution of metered power per space, and one recording per space. It contains nothing of the truth."""
    page = Page(f"Virtual measurement campaign: {title}", simulated=True)
    keys = ("recordings", "hours", "mean_W", "p99_W", "max_W")
    page.table(
        ["space", "recordings", "hours", "mean P [W]", "99th percentile [W]", "maximum [W]"],
        [[name, *(figures[key] for key in keys)] for name, figures in spaces.items()],
    )
    figure = Figure(figsize=(10, 3.4))
    panel = figure.subplots()
    first = {space: next(name for name in powers if name.split("/")[-1].startswith(space)) for space in spaces}
    by_space = {space: [p for name, p in powers.items() if name.split("/")[-1].startswith(space)] for space in spaces}
    everything = np.concatenate(list(powers.values()))
    bins = np.linspace(np.nanmin(everything), np.nanmax(everything), 90).tolist()
    for space, recordings in by_space.items():
        panel.hist(np.concatenate(recordings), bins=bins, density=True, histtype="step", label=space)
    panel.set(xlabel="metered active power P per window [W]", ylabel="probability density [1/W]", yscale="log")
    panel.legend()
    panel.grid(alpha=0.3)
    page.figure(figure, "Metered power of all recordings.", folder / "power_distribution.png")
    for space, recordings in by_space.items():
        figure = Figure(figsize=(10, 2.6))
        panel = figure.subplots()
        panel.plot(np.arange(len(recordings[0])) * window_s, recordings[0], linewidth=0.9)
        panel.set(xlabel="time since the first window [s]", ylabel="active power P [W]", title=first[space])
        panel.grid(alpha=0.3)
        page.figure(figure, f"A recording in {space} space.")
    path = folder / "report.html"
    page.write(path)
    return path
