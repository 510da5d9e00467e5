"""A motion on a foreign plant whose torques MuJoCo computes, metered by the cyclic tasks of the daemon.

The torques of `execution.energy` come from the generator's own dynamics, and its energy is a sum of watts. Here both
are replaced: rigid bodies move by MuJoCo, and the mains power becomes 20 kHz samples of voltage and current, with
noise, of which the daemon's tasks make rows and the register of energy.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from acqd.lab.instruments.full_speed_plc import FullSpeedDaemon
from acqd.lab.instruments.mains import Mains, MainsSettings
from tools.common.mujoco_oracle import inverse_dynamics
from tools.studies.foreign.generator.arm import Arm, Body, Floats
from tools.studies.foreign.generator.motion import STEP_S
from tools.studies.foreign.generator.plant import Plant
from tools.studies.saving.execution import WARM
from tools.studies.saving.programs import Executed

_WINDOW_S = 0.04
_REST_S = 1.0
"""Before and after the motion: the supply lags, and the register goes on in whole windows."""
_J_PER_KWH = 3.6e6


def metered(plant: Plant, motion: Executed, brake_open: Floats, random: np.random.Generator) -> float:
    """J of the motion by the daemon's register; `brake_open` [T] 0 or 1, `random` for mains and noise of the meter."""
    power = watts(plant, motion, brake_open)
    rest = round(_REST_S / STEP_S)
    whole = plant.supply.lagged(np.pad(power, rest, mode="edge"))
    counted_J, seconds = _register(whole, random)
    after_s = seconds - _REST_S - STEP_S * len(power)
    return counted_J - float(whole[0]) * _REST_S - float(whole[-1]) * after_s


def watts(plant: Plant, motion: Executed, brake_open: Floats) -> Floats:
    """[T] W at the mains, without the lag of the supply, by MuJoCo's torques."""
    rigid = torques(plant.arm, motion)
    motor = rigid + plant.friction.torque(motion.q, motion.qd, rigid, WARM) + plant.arm.rotor * motion.qdd
    drives = brake_open * plant.supply.joint_power(plant.arm, motor * brake_open[:, None], motion.qd)
    return plant.supply.mains(drives + plant.supply.control_W)


def torques(arm: Arm, motion: Executed) -> Floats:
    """[T, n] Nm that move the rigid bodies of an arm, by MuJoCo."""
    return inverse_dynamics(_model(arm), motion.q, motion.qd, motion.qdd)


def _register(power: Floats, random: np.random.Generator) -> tuple[float, float]:
    """J that the daemon counts of a power [T] W, and the seconds of its whole windows."""
    mains = Mains(MainsSettings(), random)
    daemon = FullSpeedDaemon(mains.form, _WINDOW_S, 0)
    try:
        t_s = np.arange(round(1000 * STEP_S * len(power)) + 1) / 1000
        codes = mains.waveform(np.interp(t_s, STEP_S * (np.arange(len(power)) + 0.5), power))
        last = list(daemon.feed(codes))[-1]
    finally:
        daemon.close()
    return float(last.W[0, -1]) * _J_PER_KWH, float(last.seq[-1] + 1) * _WINDOW_S


def _model(arm: Arm) -> Any:
    """A mujoco.MjModel of the joints and the bodies."""
    links, quaternion = "", np.empty(4)
    for number in range(arm.joints):
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(arm.turn[number]).ravel())
        links += f'<body pos="{_text(arm.offset[number])}" quat="{_text(quaternion)}">'
        links += f'<joint type="hinge" axis="{_text(arm.axis[number])}"/>'
        own = "".join(f"<body>{_inertial(body)}</body>" for body in arm.bodies if body.link == number)
        links += '<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/>' + own
    return mujoco.MjModel.from_xml_string(
        '<mujoco><compiler angle="radian" balanceinertia="false" boundmass="0"/>'
        f'<option gravity="0 0 -9.81"/><worldbody>{links}{"</body>" * arm.joints}</worldbody></mujoco>'
    )


def _inertial(body: Body) -> str:
    t = body.tensor
    elements = np.array([t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]])
    return f'<inertial pos="{_text(body.centre)}" mass="{float(body.mass)!r}" fullinertia="{_text(elements)}"/>'


def _text(values: Floats) -> str:
    return " ".join(repr(float(value)) for value in values)
