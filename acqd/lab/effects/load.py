"""Forces on the arm that its description does not contain: payloads, attached masses, contact."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.lab.plant.situation import Effect, Situation
from acqd.motion.controller import RATE
from acqd.robot.arm import Arm
from acqd.robot.dynamics import gravity_torque
from acqd.robot.kinematics import flange_jacobian

_COARSE = 10  # ms between exact values; geometry changes slowly


class Payload(Effect):
    """A payload at the flange."""

    id = "payload"
    summary = "a mass at the flange, always or (with_tool=1) only while the tool is on"
    strength = ("mass_kg", "kg")
    defaults: ClassVar = {"mass_kg": 1.0, "with_tool": 0.0}
    limits: ClassVar = {"mass_kg": (0.001, 1000), "with_tool": (0, 1)}

    def payload(self, situation: Situation) -> Floats:
        """The mass while it is carried, [T] kg."""
        carried = situation.motion.tool_on if self["with_tool"] else np.ones(len(situation.motion))
        return self["mass_kg"] * self.gate(situation) * carried


class GravityBias(Effect):
    """A mass on a link away from the flange: hoses, a dress pack, a missing counterweight."""

    id = "gravity_bias"
    summary = "weight of a mass added to (or, if negative, removed from) the link of one axis"
    strength = ("mass_kg", "kg")
    defaults: ClassVar = {"mass_kg": 0.8, "axis": 3.0}
    limits: ClassVar = {"mass_kg": (-1000, 1000), "axis": (1, 100)}

    def external_torque(self, situation: Situation) -> Floats:
        """Static torque of the added mass, [T, axes] Nm: torque sensors, which sit after the gear, measure it.

        Raises UserError when the link is lighter than the mass.
        """
        joints = list(situation.arm.description.joint)
        number = int(np.clip(self["axis"], 1, len(joints))) - 1
        link = joints[number].link
        if link.mass + self["mass_kg"] <= 0:
            raise UserError(
                f"effect {self.id}: mass_kg={self['mass_kg']:g}, but link {number + 1} has only {link.mass:.2f} kg"
            )
        joints[number] = joints[number].model_copy(
            update={"link": link.model_copy(update={"mass": link.mass + self["mass_kg"]})}
        )
        heavier = Arm(situation.arm.description.model_copy(update={"joint": joints}))
        coarse = _coarse(situation.motion.q)
        extra = gravity_torque(heavier, coarse) - gravity_torque(situation.arm, coarse)
        return _refined(extra, len(situation.motion)) * self.gate(situation)[:, None]


class Mounting(Effect):
    """The base is not mounted as the robot's description says: gravity pulls in another direction."""

    id = "mounting"
    summary = "the base is tilted, the arm leans towards a direction in the plane of the base; 180 degrees: a ceiling"
    strength = ("tilt_deg", "degrees")
    defaults: ClassVar = {"tilt_deg": 3.0, "towards_deg": 0.0}
    limits: ClassVar = {"tilt_deg": (-180, 180), "towards_deg": (-360, 360)}

    def external_torque(self, situation: Situation) -> Floats:
        """Static torque of the arm without its payload, [T, axes] Nm: torque sensors measure it."""
        tilt, towards = np.radians([self["tilt_deg"], self["towards_deg"]])
        tilted = Arm(situation.arm.description)
        pull = [np.sin(tilt) * np.cos(towards), np.sin(tilt) * np.sin(towards), -np.cos(tilt)]
        tilted.model.gravity.linear = np.linalg.norm(tilted.model.gravity.linear) * np.array(pull)
        coarse = _coarse(situation.motion.q)
        extra = gravity_torque(tilted, coarse) - gravity_torque(situation.arm, coarse)
        return _refined(extra, len(situation.motion)) * self.gate(situation)[:, None]


class ContactForce(Effect):
    """The tool presses against a surface."""

    id = "contact_force"
    summary = "an upward force on the flange in program phases named contact, insert or screw, else at random times"
    strength = ("force_N", "N")
    defaults: ClassVar = {"force_N": 25.0}

    def begin(self) -> None:
        """Set up contacts of 1 to 4 s."""
        self._bursts = Bursts(self.random, (1.0, 4.0), 12.0)

    def external_torque(self, situation: Situation) -> Floats | None:
        """Additional joint torque -J^T F, [T, axes] Nm, with the Jacobian J of the flange and the force F."""
        contact = self._contact(situation) * self.gate(situation)
        if not contact.any():
            return None
        jacobian = flange_jacobian(situation.arm, _coarse(situation.motion.q))
        torque = _refined(-jacobian[:, 2, :] * self["force_N"], len(situation.motion))
        return torque * contact[:, None]

    def _contact(self, situation: Situation) -> Floats:
        """[T] 1 during contact, 0 without, with edges of 50 ms."""
        motion = situation.motion
        working = [k for k, name in enumerate(motion.phase) if name in ("contact", "insert", "screw")]
        if working:
            contact = np.isin(motion.phase_number, working).astype(float)
        else:
            contact = self._bursts.at(situation.t) * situation.stretch.recorded
        return smoothed(contact, 0.05)


class Bursts:
    """Activity at random times: `seconds` long (uniform), `every_s` apart on average (exponential)."""

    def __init__(self, random: np.random.Generator, seconds: tuple[float, float], every_s: float) -> None:
        self._random, self._seconds, self._every_s = random, seconds, every_s
        self._switches = [random.exponential(every_s)]  # s: start, end, start ...

    def at(self, t: Floats) -> Floats:
        """[T] 1 during a burst, else 0, at times `t` (s, rising) since the start of the session."""
        while self._switches[-1] <= t[-1]:
            active = len(self._switches) % 2 == 1
            length = self._random.uniform(*self._seconds) if active else self._random.exponential(self._every_s)
            self._switches.append(self._switches[-1] + length)
        return np.asarray(np.searchsorted(self._switches, t, side="right") % 2, dtype=np.float64)


def smoothed(switch: Floats, seconds: float) -> Floats:
    """A 0/1 signal [T] with its edges stretched to `seconds` by a moving average."""
    width = max(1, int(seconds * RATE))
    return np.convolve(np.concatenate([np.full(width - 1, switch[0]), switch]), np.ones(width) / width, "valid")


def _coarse(q: Floats) -> Floats:
    return np.concatenate([q[::_COARSE], q[-1:]])


def _refined(values: Floats, samples: int) -> Floats:
    """Interpolate coarse rows linearly to 1 kHz, [samples, n]."""
    at = np.append(np.arange(0, samples, _COARSE), samples - 1)
    t = np.arange(samples)
    return np.column_stack([np.interp(t, at, column) for column in values.T])
