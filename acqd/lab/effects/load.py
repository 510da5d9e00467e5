"""Forces on the arm that its description does not know: things carried, things pushed against."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.lab.motion.controller import RATE
from acqd.lab.plant.situation import Effect, Situation
from acqd.robot.arm import Arm
from acqd.robot.dynamics import gravity_torque
from acqd.robot.kinematics import flange_jacobian

_COARSE = 10  # ms between exact values of slowly changing geometry


class Payload(Effect):
    """A body at the flange."""

    id = "payload"
    summary = "a mass at the flange: always, or (with_tool=1) while the tool is on"
    strength = ("mass_kg", "kg")
    defaults: ClassVar = {"mass_kg": 1.0, "with_tool": 0.0}
    limits: ClassVar = {"mass_kg": (0.001, 1000), "with_tool": (0, 1)}

    def payload(self, situation: Situation) -> Floats:
        """The mass where it is carried."""
        carried = situation.motion.tool_on if self["with_tool"] else np.ones(len(situation.motion))
        return self["mass_kg"] * self.gate(situation) * carried


class GravityBias(Effect):
    """A body on a link, far from the flange: hoses, a dress pack, a counterweight gone missing."""

    id = "gravity_bias"
    summary = "weight of a mass on one link (axis), positive or negative"
    strength = ("mass_kg", "kg")
    defaults: ClassVar = {"mass_kg": 0.8, "axis": 3.0}
    limits: ClassVar = {"mass_kg": (-1000, 1000), "axis": (1, 100)}

    def torque(self, situation: Situation) -> Floats:
        """Its static torque."""
        joints = list(situation.arm.description.joint)
        number = int(np.clip(self["axis"], 1, len(joints))) - 1
        link = joints[number].link
        if link.mass + self["mass_kg"] <= 0:
            raise UserError(f"effect {self.id}: link {number + 1} has only {link.mass:.2f} kg to lose")
        joints[number] = joints[number].model_copy(
            update={"link": link.model_copy(update={"mass": link.mass + self["mass_kg"]})}
        )
        heavier = Arm(situation.arm.description.model_copy(update={"joint": joints}))
        coarse = _coarse(situation.motion.q)
        extra = gravity_torque(heavier, coarse) - gravity_torque(situation.arm, coarse)
        return _refined(extra, len(situation.motion)) * self.gate(situation)[:, None]


class ContactForce(Effect):
    """The tool pushes against something."""

    id = "contact_force"
    summary = "an upward force on the flange, in phases named contact, insert or screw, else now and then"
    strength = ("force_N", "N")
    defaults: ClassVar = {"force_N": 25.0}

    def begin(self) -> None:
        """Presses of 1 to 4 s."""
        self._bursts = Bursts(self.random, (1.0, 4.0), 12.0)

    def external_torque(self, situation: Situation) -> Floats | None:
        """What the joints need on top: minus the transposed Jacobian times the force."""
        pressed = self._pressed(situation) * self.gate(situation)
        if not pressed.any():
            return None
        jacobian = flange_jacobian(situation.arm, _coarse(situation.motion.q))
        torque = _refined(-jacobian[:, 2, :] * self["force_N"], len(situation.motion))
        return torque * pressed[:, None]

    def _pressed(self, situation: Situation) -> Floats:
        motion = situation.motion
        working = [k for k, name in enumerate(motion.phase) if name in ("contact", "insert", "screw")]
        if working:
            pressed = np.isin(motion.phase_number, working).astype(float)
        else:
            pressed = self._bursts.at(situation.t) * situation.stretch.recorded
        return smoothed(pressed, 0.05)


class Bursts:
    """Activity of random length that comes at random, every so many seconds of the session."""

    def __init__(self, random: np.random.Generator, seconds: tuple[float, float], every_s: float) -> None:
        self._random, self._seconds, self._every_s = random, seconds, every_s
        self._switches = [random.exponential(every_s)]  # times of beginning, ending, beginning ...

    def at(self, t: Floats) -> Floats:
        """[T] 1 during a burst, else 0, at session times `t` (s)."""
        while self._switches[-1] <= t[-1]:
            active = len(self._switches) % 2 == 1
            length = self._random.uniform(*self._seconds) if active else self._random.exponential(self._every_s)
            self._switches.append(self._switches[-1] + length)
        return np.asarray(np.searchsorted(self._switches, t, side="right") % 2, dtype=np.float64)


def smoothed(switch: Floats, seconds: float) -> Floats:
    """A 0/1 signal with edges as long as `seconds`."""
    width = max(1, int(seconds * RATE))
    return np.convolve(np.concatenate([np.full(width - 1, switch[0]), switch]), np.ones(width) / width, "valid")


def _coarse(q: Floats) -> Floats:
    return np.concatenate([q[::_COARSE], q[-1:]])


def _refined(values: Floats, samples: int) -> Floats:
    """Coarse rows back to 1 kHz, linear in between."""
    at = np.append(np.arange(0, samples, _COARSE), samples - 1)
    t = np.arange(samples)
    return np.column_stack([np.interp(t, at, column) for column in values.T])
