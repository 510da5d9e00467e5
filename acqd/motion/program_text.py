"""Programs as texts: timed joints, URScript, Sunrise snippets. A person has to check them before anything moves.

The texts hold positions, speeds or times, and pauses, and nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.motion.chain import Move
from acqd.motion.controller import RATE, Motion, Step, SwitchTool, Wait
from acqd.robot.description import RobotDescription

_ROWS_PER_S = 100
_UR_AXES, _LBR_AXES = 6, 7
_STREAM_S = 0.02
"""Between two positions that are streamed to a controller."""


def timed_joints(motion: Motion, *, signals: bool = False) -> str:
    """CSV of time [s] and joints [rad] at 100 Hz, which `acqd lab execute` replays.

    `signals` adds brake (1: open) and tool, 0 or 1.
    """
    every = RATE // _ROWS_PER_S
    header = ["time", *(f"q{axis + 1}" for axis in range(motion.q.shape[1])), *(["brake", "tool"] if signals else [])]
    lines = [",".join(header)]
    for k in range(0, len(motion), every):
        states = [str(int(motion.brake_open[k])), str(int(motion.tool_on[k]))] if signals else []
        lines.append(",".join([f"{k / RATE:.2f}", *(f"{value:.6f}" for value in motion.q[k]), *states]))
    return "\n".join([*lines, ""])


def programs(
    robot: RobotDescription, start: Move, steps: tuple[Step, ...], warning: str, name: str
) -> dict[str, str]:  # fmt: skip
    """Text by file name: URScript for six axes, Java for Sunrise for seven; for other robots none.

    `name` is that of the function in URScript.
    """
    if robot.sliding:
        return {}
    if robot.axes == _UR_AXES:
        return {"program.script": "\n".join([*_ur_script(robot, start, steps, warning, name), ""])}
    if robot.axes == _LBR_AXES:
        return {"Program.java": "\n".join([*_sunrise(start, steps, warning), ""])}
    return {}


def streamed(robot: RobotDescription, start: Move, motion: Motion, warning: str, name: str) -> dict[str, str]:
    """As `programs`, of a motion that no few commands describe: positions at even times, for servo commands."""
    if robot.sliding:
        return {}
    q = motion.q[:: round(_STREAM_S * RATE)]
    if robot.axes == _UR_AXES:
        speed, acceleration = _leading(robot, np.ones(robot.axes), start)
        lines = [
            f"# {warning}", "# URScript, for controllers of Universal Robots; the tool is not switched",
            f"def {name}():",
            f"  movej([{_values(q[0])}], a={acceleration:.4f}, v={speed:.4f})",
            *(f"  servoj([{_values(row)}], t={_STREAM_S:.2f}, lookahead_time=0.1, gain=300)" for row in q),
            "  stopj(1.0)", "end", f"{name}()", "",
        ]  # fmt: skip
        return {"program.script": "\n".join(lines)}
    if robot.axes == _LBR_AXES:
        lines = [
            f"// {warning}",
            "// Insert into run() of a RoboticsAPIApplication with Sunrise.Servoing; `robot` is the LBR. The tool is",
            "// not switched. motion.csv, beside this file, has time in s and seven angles in rad, at 100 Hz.",
            f"robot.move(ptp({_values(q[0])}).setJointVelocityRel({start.relative_speed:.4f}));",
            "SmartServo servo = new SmartServo(robot.getCurrentJointPosition());",
            "robot.moveAsync(servo);",
            "long begin = System.nanoTime();",
            'for (String line : Files.readAllLines(Paths.get("motion.csv"), StandardCharsets.UTF_8)) {',
            '    if (line.startsWith("time")) continue;',
            '    String[] cell = line.split(",");',
            "    double[] q = new double[7];",
            "    for (int k = 0; k < 7; k++) q[k] = Double.parseDouble(cell[k + 1]);",
            "    while (System.nanoTime() - begin < 1e9 * Double.parseDouble(cell[0])) ThreadUtil.milliSleep(1);",
            "    servo.getRuntime().setDestination(new JointPosition(q));",
            "}",
            "servo.getRuntime().stopMotion();",
            "",
        ]
        return {"Program.java": "\n".join(lines)}
    return {}


def _ur_script(
    robot: RobotDescription, start: Move, steps: tuple[Step, ...], warning: str, name: str
) -> Iterator[str]:  # fmt: skip
    yield f"# {warning}"
    yield "# URScript, for controllers of Universal Robots; corners are not blended"
    yield f"def {name}():"
    position = start.target
    for step in _together(start, steps):
        if isinstance(step, Move):
            speed, acceleration = _leading(robot, step.target - position, step)
            yield f"  movej([{_values(step.target)}], a={acceleration:.4f}, v={speed:.4f})"
            position = step.target
        elif isinstance(step, SwitchTool):
            yield f"  # {_tool(step)}"
            yield f"  sleep({step.seconds:.2f})"
        elif isinstance(step, Wait):
            yield f"  sleep({step.seconds:.2f})"
    yield "end"
    yield f"{name}()"


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
        elif isinstance(step, SwitchTool):
            yield f"// {_tool(step)}"
            yield f"ThreadUtil.milliSleep({round(1000 * step.seconds)});"
        elif isinstance(step, Wait):
            yield f"ThreadUtil.milliSleep({round(1000 * step.seconds)});"


def _tool(step: SwitchTool) -> str:
    return f"{'close' if step.on else 'open'} the tool here: its command depends on the cell"


def _together(start: Move, steps: tuple[Step, ...]) -> Iterator[Step]:
    """The way to the start, and the steps without motions of no length; neighbouring pauses are one."""
    yield start
    position, pause = start.target, 0.0
    for step in steps:
        if isinstance(step, Wait):
            pause += step.seconds
            continue
        moves = isinstance(step, Move) and np.abs(step.target - position).max() > 1e-9
        if not moves and not isinstance(step, SwitchTool):
            continue
        if pause:
            yield Wait(pause)
            pause = 0.0
        yield replace(step)
        if isinstance(step, Move):
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
