"""Scale of a model's torques: what a kilogram or a newton metre of the model is in the world.

Power alone fixes the product of torque and gain. A model of torques that are 10 % too small explains a payload of
2 kg by 1.8 kg. The described link masses tell the scale, where no torque sensor does: by the slope of the model's
rigid-body torque on the described one, with the nominal drives as a prior. How far both can be trusted is in the
robot's description (`mass_deviation`, `drive_deviation`); drives that nobody has described are trusted less. A move
with a known mass (`acqd robot calibrate`) measures the scale; the bundle then holds the result.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.residual.logged_torque import has_torque
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inertial_parameters
from acqd.robot.newton_euler import joint_torques

GUESSED_DRIVE_DEVIATION = 0.3
"""Of mains power per torque and speed where the torque constants are guessed: gears lose 5 to 40 % of the power."""
KEY = "torque_scale"
"""Of the calibrated scale in bundle.json."""
_SEGMENTS = 60
"""Most segments that a scale is taken from: more would take longer and change nothing."""
_POWERS = {
    "kg": -1, "kg m": -1, "Nm": -1, "N": -1, "Nm s/rad": -1, "N s/m": -1, "W/Nm^2": 2, "W/N^2": 2, "W/Nm": 1, "W/N": 1,
}  # fmt: skip
"""Power of the scale by which a parameter of that unit is corrected."""


@dataclass(frozen=True, slots=True)
class TorqueScale:
    """The model's torques over the true torques."""

    value: float
    deviation: float
    """Standard deviation."""

    def corrected(self, value: float, half: float, unit: str) -> tuple[float, float]:
        """A parameter in true units, and half the width of its 95 % interval with the scale's uncertainty."""
        power = _POWERS.get(unit, 0)
        factor = self.value**power
        of_scale = THRESHOLDS.interval_width * power * self.deviation / self.value * value
        return value * factor, float(np.hypot(half, of_scale) * factor)


def torque_scale(subject: Subject) -> TorqueScale:
    """From the recordings in question and the robot's description."""
    calibrated = subject.bundle.metadata.get(KEY)
    if calibrated is not None:
        return TorqueScale(calibrated["value"], calibrated["deviation"])
    segments = [*subject.reference, *subject.fit]
    if all(has_torque(segment, "link") for segment in segments):
        return TorqueScale(1.0, THRESHOLDS.sensor_scale_deviation)
    model, described = subject.carrier, inertial_parameters(subject.robot)
    links = np.kron(np.eye(subject.robot.axes), np.ones(10)) * described
    arms = np.vstack([model.group("inertial"), described, links])
    products = np.zeros(len(arms))
    for segment in segments[:: math.ceil(len(segments) / _SEGMENTS)]:
        torques = joint_torques(model.chain, arms, *segment.motion(subject.data.step_s))
        products += np.einsum("nta,ta->n", torques, torques[1])
    slope, _, *shares = (products / max(products[1], 1e-9)).tolist()
    deviation = subject.robot.mass_deviation * float(np.hypot.reduce(shares))
    return _combined(slope, deviation, drive_deviation(subject.robot))


def drive_deviation(robot: RobotDescription) -> float:
    """Relative deviation of mains power per torque and speed: as described, or that of guessed drives."""
    guessed = any(joint.guesses_drive for joint in robot.joint)
    if guessed and "drive_deviation" not in robot.model_fields_set:
        return GUESSED_DRIVE_DEVIATION
    return robot.drive_deviation


def scale_notes(subject: Subject) -> list[str]:
    """What the sizes of a robot with guessed drives rest on, and how to know better."""
    if subject.bundle.metadata.get(KEY) is not None or not any(joint.guesses_drive for joint in subject.robot.joint):
        return []
    scale = torque_scale(subject)
    if scale.deviation <= THRESHOLDS.sensor_scale_deviation:
        return []
    percent = 100 * THRESHOLDS.interval_width * scale.deviation / scale.value
    return [
        f"the drives of {subject.robot.name} are guessed: masses and torques rest on the described link masses, within "
        f"{percent:.0f} % (95 %); only the product of torque and "
        "gain shows in the power. A move with a known mass tells the scale: acqd robot calibrate DS --known-mass KG"
    ]


def _combined(slope: float, deviation: float, of_drives: float) -> TorqueScale:
    """Two measurements of one scale, by their precisions: `slope` on the described torques, and 1 by the drives.

    Errors of the described masses are independent from link to link, so that `deviation` is less than that of a link.
    """
    weights = np.array([deviation, of_drives]) ** -2.0
    return TorqueScale(float(np.average([slope, 1.0], weights=weights)), float(weights.sum() ** -0.5))
