"""A designed program as files: timed joints, URScript, a Sunrise snippet, next.json, next.html.

The texts are for a person to check before anything moves. They hold positions, relative speeds and pauses, and nothing
else.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import orjson

from acqd.arrays import Floats
from acqd.atomic import complete_folder
from acqd.errors import UserError
from acqd.experiment.design import Designed, as_json
from acqd.experiment.page import write_page
from acqd.motion.chain import Move
from acqd.motion.controller import RATE, Step, Wait
from acqd.report.chain import REPORT, connect
from acqd.robot.description import RobotDescription

_ROWS_PER_S = 100
_UR_AXES, _LBR_AXES = 6, 7
_SLOWLY = 0.05
"""Share of the limits on the way to the start, which nobody has checked."""
MOTION = "motion.csv"
_CHECK = "Designed by acqd next for {robot}: {seconds:.0f} s, begins with {gears} gears. A person has to check this "
_CHECK_2 = (
    "program before the robot moves: reach, tool, load, people. Collisions were checked for the described arm in "
)
_CHECK_3 = "scene '{scene}' only, and not on the way to the start: drive there by hand. Run it at reduced speed first."


def require_writable(folder: Path) -> None:
    """A folder that is absent, empty or an earlier design. Raises UserError."""
    if folder.exists() and not (folder / "next.json").exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder} exists and is not an earlier design: it would be lost; choose another --out")


def write_all(folder: Path, designed: Designed) -> None:
    """Fill the folder, completely or not at all. Raises UserError, OperationError."""
    robot, start = designed.question.subject.robot, designed.space.home
    with complete_folder(folder) as out:
        (out / MOTION).write_text(timed(designed), encoding="utf-8")
        slowly = tuple(min(_SLOWLY, share) for share in designed.space.greatest_shares)
        for name, text in programs(robot, Move(start, *slowly), designed.steps, _warning(designed)).items():
            (out / name).write_text(text, encoding="utf-8")
        (out / "next.json").write_bytes(orjson.dumps(as_json(designed), option=orjson.OPT_INDENT_2))
        write_page(out / "next.html", designed)
    connect(folder / "next.html", [designed.question.report / REPORT])


def timed(designed: Designed) -> str:
    """CSV of time [s] and joints [rad], which `acqd lab execute` replays."""
    motion, axes = designed.motion, designed.space.arm.axes
    every = RATE // _ROWS_PER_S
    header = ",".join(["time", *(f"q{axis + 1}" for axis in range(axes))])
    rows = (
        ",".join([f"{k / RATE:.2f}", *(f"{value:.6f}" for value in motion.q[k])]) for k in range(0, len(motion), every)
    )
    return "\n".join([header, *rows, ""])


def programs(robot: RobotDescription, start: Move, steps: tuple[Step, ...], warning: str) -> dict[str, str]:
    """Text by file name: URScript for six axes, Java for Sunrise for seven; for other robots the timed joints only."""
    if robot.sliding:
        return {}
    if robot.axes == _UR_AXES:
        return {"program.script": "\n".join([*_ur_script(robot, start, steps, warning), ""])}
    if robot.axes == _LBR_AXES:
        return {"Program.java": "\n".join([*_sunrise(start, steps, warning), ""])}
    return {}


def _warning(designed: Designed) -> str:
    gears = "cold" if designed.cold else "warm"
    return (_CHECK + _CHECK_2 + _CHECK_3).format(
        robot=designed.question.subject.robot.name, seconds=designed.motion.seconds, gears=gears,
        scene=designed.asked.scene,
    )  # fmt: skip


def _ur_script(robot: RobotDescription, start: Move, steps: tuple[Step, ...], warning: str) -> Iterator[str]:
    yield f"# {warning}"
    yield "# URScript, for controllers of Universal Robots; corners are not blended"
    yield "def acqd_next():"
    position = start.target
    for step in _together(start, steps):
        if isinstance(step, Move):
            speed, acceleration = _leading(robot, step.target - position, step)
            yield f"  movej([{_values(step.target)}], a={acceleration:.4f}, v={speed:.4f})"
            position = step.target
        elif isinstance(step, Wait):
            yield f"  sleep({step.seconds:.2f})"
    yield "end"
    yield "acqd_next()"


def _sunrise(start: Move, steps: tuple[Step, ...], warning: str) -> Iterator[str]:
    yield f"// {warning}"
    yield "// Insert into run() of a RoboticsAPIApplication; `robot` is the LBR. Rates are shares of its limits."
    for step in _together(start, steps):
        if isinstance(step, Move):
            rates = (
                f".setJointVelocityRel({step.relative_speed:.4f})"
                f".setJointAccelerationRel({min(step.relative_acceleration, 1.0):.4f})"
            )
            yield f"robot.move(ptp({_values(step.target)}){rates});"
        elif isinstance(step, Wait):
            yield f"ThreadUtil.milliSleep({round(1000 * step.seconds)});"


def _together(start: Move, steps: tuple[Step, ...]) -> Iterator[Step]:
    """The way to the start, and the steps without motions of no length; neighbouring pauses are one."""
    yield start
    position, pause = start.target, 0.0
    for step in steps:
        if isinstance(step, Wait):
            pause += step.seconds
        elif isinstance(step, Move) and np.abs(step.target - position).max() > 1e-9:
            if pause:
                yield Wait(pause)
                pause = 0.0
            yield replace(step)
            position = step.target
    if pause:
        yield Wait(pause)


def _leading(robot: RobotDescription, distance: Floats, step: Move) -> tuple[float, float]:
    """Speed [rad/s] and acceleration [rad/s^2] of the axis with the longest way, as movej counts them."""
    length = np.maximum(np.abs(distance), 1e-9)
    longest = float(length.max())
    speed = step.relative_speed * float((robot.speed / length).min()) * longest
    return speed, step.relative_acceleration * float((robot.acceleration / length).min()) * longest


def _values(q: Floats) -> str:
    return ", ".join(f"{value:.5f}" for value in q)
