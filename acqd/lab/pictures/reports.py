"""The HTML reports of `acqd lab`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from acqd.lab.cell import MOTION, Cell
from acqd.lab.controller import RATE, Controller
from acqd.lab.generate import Generated
from acqd.lab.pictures import workspace
from acqd.lab.session import SessionTruth, windows_within
from acqd.lab.trajectory import Trajectory
from acqd.report import Page
from acqd.robot.description import Floats


def trajectories_report(cell: Cell, generated: Generated, folder: Path) -> Path:
    """Workspaces, points, blending, and two executions of one trajectory; pictures also as PNG."""
    page = Page(f"Excitation trajectories of {cell.robot.title}", simulated=True)
    page.text(f"Scene {cell.scene.name}: {', '.join(box.name for box in cell.scene.box) or 'empty'}.")
    columns = ("trajectories", "points", "unreachable", "colliding")
    rows = [[space, *(tally[key] for key in columns)] for space, tally in generated.summary().items()]
    page.table(["space", "trajectories", "points", "unreachable, drawn again", "colliding, drawn again"], rows)
    if generated.limited:
        page.heading("Limited space (Algorithm 1)")
        figure = workspace.limited_space(cell.arm, cell.scene, cell.cube(), generated.limited)
        page.figure(figure, "Cube, points and PTP ways, as thesis Figure 5.1.", folder / "limited_space.png")
    if generated.all_space:
        page.heading("All space (Algorithm 2)")
        figure = workspace.all_space(cell.arm, cell.scene, generated.all_space)
        page.figure(figure, "Collision boxes and poses, as thesis Figure 5.2.", folder / "all_space.png")
    shown = (generated.limited or generated.all_space)[0]
    executed = [_executed(cell, shown, number) for number in (1, 2)]
    page.heading("Execution")
    figure = workspace.blending(cell.arm, shown, executed[0][::20])
    page.figure(figure, "Blending cuts the corners, as thesis Figure 5.3.", folder / "blending.png")
    figure = workspace.two_executions([joint.name for joint in cell.robot.joint], executed, RATE)
    page.figure(figure, f"{shown.name} executed twice, as thesis Figure 5.4.", folder / "two_executions.png")
    path = folder / "report.html"
    page.write(path)
    return path


def _executed(cell: Cell, trajectory: Trajectory, number: int) -> Floats:
    controller = Controller(cell.robot, trajectory.waypoints[0])
    return controller.run(cell.planner.program(trajectory, cell.random(MOTION, number, 1))).q


def execution_report(cell: Cell, truth: SessionTruth, q: Floats, folder: Path) -> Path:
    """What one execution drew from the mains, and where the energy went."""
    recording = truth.recordings[0]
    page = Page(f"{recording.name} on the virtual {cell.robot.title}", simulated=True)
    within = windows_within(recording.start_s, recording.seconds, truth.window_s)
    t = np.arange(within.start, within.stop) * truth.window_s - recording.start_s
    figure = Figure(figsize=(10, 6.2))
    power, angles = figure.subplots(2, 1, sharex=True)
    power.plot(t, truth.metered[within], label="metered P", color="#2563eb", linewidth=1)
    power.plot(t, truth.power[within], label="true mean power", color="#d97706", linewidth=0.8, linestyle="--")
    power.set_ylabel("P [W]")
    power.legend(fontsize=8)
    for axis, joint in enumerate(cell.robot.joint):
        angles.plot(np.arange(0, len(q), 20) / RATE, np.degrees(q[::20, axis]), linewidth=0.9, label=joint.name)
    angles.set(xlabel="time [s]", ylabel="axis angle [°]")
    angles.legend(fontsize=7, ncol=len(cell.robot.joint))
    for panel in (power, angles):
        panel.grid(alpha=0.3)
    figure.tight_layout()
    page.figure(figure, "Power at the mains and joint angles.", folder / "power.png")
    page.heading("Energy")
    dissipated = truth.energy["dissipated_J"]
    rows: list[list[object]] = [
        [name, joules] for name, joules in sorted(dissipated.items(), key=lambda item: -item[1])
    ]
    rows += [["stored at the end, more than at the beginning", truth.energy["stored_J"]]]
    rows += [["supplied by the mains", truth.energy["supplied_J"]]]
    page.table(["channel", "J"], rows)
    page.text(f"Unaccounted for: {truth.energy['unaccounted_share']:.1e} of the supplied energy.")
    path = folder / "report.html"
    page.write(path)
    return path


def campaign_report(
    powers: dict[str, Floats], spaces: dict[str, dict[str, float]], sessions: list[dict[str, Any]], folder: Path
) -> Path:
    """Distribution of power per space, sample recordings, figures of every session."""
    page = Page("Virtual measurement campaign", simulated=True)
    keys = ("recordings", "hours", "mean_W", "p99_W", "max_W")
    page.table(
        ["space", "recordings", "hours", "mean P [W]", "p99 [W]", "max [W]"],
        [[name, *(figures[key] for key in keys)] for name, figures in spaces.items()],
    )
    figure = Figure(figsize=(10, 3.4))
    panel = figure.subplots()
    by_space = {space: [p for name, p in powers.items() if name.split("/")[-1].startswith(space)] for space in spaces}
    for space, recordings in by_space.items():
        panel.hist(np.concatenate(recordings), bins=160, density=True, histtype="step", label=space)
    panel.set(xlabel="metered P per window [W]", ylabel="density [1/W]", yscale="log")
    panel.legend()
    panel.grid(alpha=0.3)
    page.figure(figure, "Metered power of all recordings.", folder / "power_distribution.png")
    for space, recordings in by_space.items():
        figure = Figure(figsize=(10, 2.6))
        panel = figure.subplots()
        panel.plot(np.arange(len(recordings[0])) * 0.04, recordings[0], linewidth=0.9)
        panel.set(xlabel="window times 40 ms [s]", ylabel="P [W]", title=f"first recording, {space}")
        panel.grid(alpha=0.3)
        page.figure(figure, f"A recording in {space} space.")
    page.heading("Sessions")
    page.table(
        ["session", "recordings", "seconds", "unaccounted energy", "worst steady second"],
        [_session_row(session) for session in sessions],
    )
    path = folder / "report.html"
    page.write(path)
    return path


def _session_row(session: dict[str, Any]) -> list[object]:
    unaccounted, steady = session["energy"]["unaccounted_share"], session["steady"]["second_worst"]
    return [session["session"], len(session["recordings"]), session["seconds"], f"{unaccounted:.1e}", f"{steady:.1e}"]
