"""The report of `acqd lab trajectories`."""

from __future__ import annotations

from pathlib import Path

from acqd.arrays import Floats
from acqd.lab.campaign.trajectory_set import TrajectorySet
from acqd.lab.cell import MOTION, Cell
from acqd.lab.report import figures
from acqd.motion.controller import RATE, Controller
from acqd.motion.trajectory import Trajectory
from acqd.report import KeyFigure, Page, Verdict


def trajectories_report(cell: Cell, trajectories: TrajectorySet, folder: Path) -> Path:
    """Workspaces, points, blending, and two executions of one trajectory; figures also as PNG."""
    page = Page(
        f"Excitation trajectories of {cell.robot.title}", simulated=True, kind="trajectories", subject=cell.robot.name
    )
    page.verdict(_verdict(cell, trajectories))
    columns = ("trajectories", "points", "unreachable", "colliding")
    rows = [[space, *(tally[key] for key in columns)] for space, tally in trajectories.summary().items()]
    page.heading("Points")
    page.table(["space", "trajectories", "points", "rejected: unreachable", "rejected: colliding"], rows)
    if trajectories.limited:
        page.heading("Limited space (Algorithm 1)")
        figure = figures.limited_space(cell.arm, cell.scene, cell.cube(), trajectories.limited)
        page.figure(
            figure, "Cube, points and PTP paths.", source="Thesis Figure 5.1.", png=folder / "limited_space.png"
        )
    if trajectories.all_space:
        page.heading("All space (Algorithm 2)")
        figure = figures.all_space(cell.arm, cell.scene, trajectories.all_space)
        page.figure(figure, "Collision boxes and poses.", source="Thesis Figure 5.2.", png=folder / "all_space.png")
    shown = (trajectories.limited or trajectories.all_space)[0]
    executed = [_executed(cell, shown, number) for number in (1, 2)]
    page.heading("Execution")
    figure = figures.blending(cell.arm, shown, executed[0][::20])
    page.figure(figure, "Blending cuts the corners.", source="Thesis Figure 5.3.", png=folder / "blending.png")
    figure = figures.two_executions([joint.name for joint in cell.robot.joint], executed, RATE)
    page.figure(
        figure, f"Two executions of {shown.name}.", source="Thesis Figure 5.4.", png=folder / "two_executions.png"
    )
    page.detail("seed", cell.settings.seed)
    path = folder / "report.html"
    page.write(path)
    return path


def _verdict(cell: Cell, trajectories: TrajectorySet) -> Verdict:
    tallies = trajectories.summary().values()
    count = sum(tally["trajectories"] for tally in tallies)
    rejected = sum(tally["unreachable"] + tally["colliding"] for tally in tallies)
    figures = [
        KeyFigure("points", str(sum(tally["points"] for tally in tallies)), "all reachable and free of collisions"),
        KeyFigure("rejected draws", str(rejected), "unreachable or colliding"),
    ]
    boxes = ", ".join(box.name for box in cell.scene.box) or "empty"
    return Verdict("fine", f"{count} trajectories are ready to execute", f"Scene {cell.scene.name}: {boxes}.", figures)


def _executed(cell: Cell, trajectory: Trajectory, number: int) -> Floats:
    controller = Controller(cell.robot, trajectory.waypoints[0])
    return controller.run(cell.planner.program(trajectory, cell.random(MOTION, number, 1))).q
