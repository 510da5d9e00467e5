"""Gears that deteriorate: friction and ripple in addition to the friction of the plant."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.lab.plant.mechanics import direction
from acqd.lab.plant.parameters import per_axis
from acqd.lab.plant.situation import Effect, Situation
from acqd.motion.controller import RATE


def only_axis(axis: float, axes: int) -> Floats:
    """[axes] weights: 1 at `axis` (from 1) and 0 elsewhere, or 1 everywhere for axis 0."""
    if axis == 0:
        return np.ones(axes)
    chosen = np.zeros(axes)
    chosen[int(np.clip(axis, 1, axes)) - 1] = 1.0
    return chosen


class _Friction(Effect):
    def _axis_gate(self, situation: Situation) -> Floats:
        """[T, axes]: the gate on the chosen axes, 0 on the others."""
        return self.gate(situation)[:, None] * only_axis(self["axis"], situation.motion.q.shape[1])


class CoulombFriction(_Friction):
    """Coulomb friction rises: a misaligned or dry gear."""

    id = "coulomb_friction"
    summary = "Coulomb friction rises by a share, on one axis or (axis=0) on all axes"
    strength = ("relative", "of the present Coulomb friction")
    defaults: ClassVar = {"relative": 0.4, "axis": 0.0}
    limits: ClassVar = {"relative": (-1, 100), "axis": (0, 100)}

    def torque(self, situation: Situation) -> Floats:
        """Constant friction torque against the motion, [T, axes] Nm."""
        nominal = per_axis(situation.parameters.friction.coulomb_Nm)
        return self["relative"] * nominal * direction(situation.motion.qd) * self._axis_gate(situation)


class ViscousFriction(_Friction):
    """Viscous friction rises: the wrong grease."""

    id = "viscous_friction"
    summary = "viscous friction rises by a share, on one axis or (axis=0) on all axes"
    strength = ("relative", "of the present viscous friction")
    defaults: ClassVar = {"relative": 0.5, "axis": 0.0}
    limits: ClassVar = {"relative": (-1, 100), "axis": (0, 100)}

    def torque(self, situation: Situation) -> Floats:
        """Friction torque proportional to the speed, [T, axes] Nm."""
        nominal = per_axis(situation.parameters.friction.viscous_Nms_rad)
        return self["relative"] * nominal * situation.motion.qd * self._axis_gate(situation)


class StribeckFriction(_Friction):
    """Stribeck friction: additional friction near standstill."""

    id = "stribeck_friction"
    summary = "friction near standstill that decreases with the speed (speed_rad_s)"
    strength = ("torque_Nm", "Nm")
    defaults: ClassVar = {"torque_Nm": 4.0, "speed_rad_s": 0.12, "axis": 0.0}
    limits: ClassVar = {"speed_rad_s": (1e-3, 10), "axis": (0, 100)}

    def torque(self, situation: Situation) -> Floats:
        """Friction torque that decays as a Gaussian of the speed, [T, axes] Nm."""
        qd = situation.motion.qd
        bump = np.exp(-((qd / self["speed_rad_s"]) ** 2)) * direction(qd)
        return self["torque_Nm"] * bump * self._axis_gate(situation)


class LoadDependentFriction(_Friction):
    """Coulomb friction proportional to the torque that the gear transmits."""

    id = "load_dependent_friction"
    summary = "Coulomb friction proportional to the transmitted torque"
    strength = ("relative", "of the transmitted torque")
    defaults: ClassVar = {"relative": 0.12, "axis": 0.0}
    limits: ClassVar = {"relative": (0, 10), "axis": (0, 100)}

    def torque(self, situation: Situation) -> Floats:
        """Share of the rigid-body torque, against the motion, [T, axes] Nm."""
        load = np.abs(situation.tau_rigid)
        return self["relative"] * load * direction(situation.motion.qd) * self._axis_gate(situation)


class ThermalFriction(_Friction):
    """A cold start: extra viscous friction that falls while the arm moves and returns while it rests."""

    id = "thermal_friction"
    summary = "extra viscous friction of cold gears; minutes is the time constant of warming up in motion"
    strength = ("relative", "of the warm viscous friction")
    defaults: ClassVar = {"relative": 0.8, "minutes": 25.0, "axis": 0.0}
    limits: ClassVar = {"relative": (-1, 100), "minutes": (0.01, 1e5), "axis": (0, 100)}

    def begin(self) -> None:
        """The gears are cold."""
        self._warmth = 0.0  # 0 cold to 1 warm

    def work(self, seconds: float) -> None:
        """The gears have warmed up, unless they become cold later."""
        if self.onset == (1, 0.0):
            self._warmth = float(-np.expm1(-seconds / (60 * self["minutes"])))

    def torque(self, situation: Situation) -> Floats:
        """Viscous torque of the part that is still cold, [T, axes] Nm."""
        qd = situation.motion.qd
        moving = (np.abs(qd).max(axis=1) > 0) * self.gate(situation)  # the gears are cold at the onset
        keep = np.exp(-1 / (RATE * 60 * self["minutes"]))
        warmth, _ = lfilter([1 - keep], [1, -keep], moving, zi=[keep * self._warmth])
        self._warmth = float(warmth[-1])
        cold = self["relative"] * (1 - warmth)[:, None]
        viscous = per_axis(situation.parameters.friction.viscous_Nms_rad)
        return np.asarray(cold * viscous * qd * self._axis_gate(situation))


class GearRipple(_Friction):
    """Torque that is periodic in the gear's angle: an eccentric wave generator, a worn tooth."""

    id = "gear_ripple"
    summary = "torque that is periodic in the angle of one axis (periods per turn)"
    strength = ("torque_Nm", "Nm")
    defaults: ClassVar = {"torque_Nm": 6.0, "axis": 2.0, "periods": 24.0}
    limits: ClassVar = {"axis": (0, 100), "periods": (0.1, 1e5)}

    def torque(self, situation: Situation) -> Floats:
        """Sine of the gear's angle, [T, axes] Nm. The torque is conservative: on average only copper loss remains."""
        angle = situation.motion.q * self["periods"]
        return self["torque_Nm"] * np.sin(angle) * self._axis_gate(situation)


class Spring(_Friction):
    """A hose package that pulls a joint back: the closing loop has no name for this effect."""

    id = "spring"
    summary = "a spring on one axis that rests at the angle rest_rad: a hose package (outside the loop's library)"
    strength = ("stiffness_Nm_rad", "Nm/rad")
    defaults: ClassVar = {"stiffness_Nm_rad": 10.0, "axis": 3.0, "rest_rad": 0.0}
    limits: ClassVar = {"stiffness_Nm_rad": (0, 1e4), "axis": (1, 100), "rest_rad": (-7, 7)}

    def torque(self, situation: Situation) -> Floats:
        """Proportional to the angle from rest, [T, axes] Nm; conservative."""
        angle = situation.motion.q - self["rest_rad"]
        return self["stiffness_Nm_rad"] * angle * self._axis_gate(situation)


class MechanicalPower(_Friction):
    """The efficiency of a gear falls: a share of the mechanical power is lost in either direction of flow."""

    id = "mechanical_power"
    summary = "a share of the mechanical power through the gears is lost"
    strength = ("relative", "of the mechanical power")
    defaults: ClassVar = {"relative": 0.15, "axis": 0.0}
    limits: ClassVar = {"relative": (0, 10), "axis": (0, 100)}

    def torque(self, situation: Situation) -> Floats:
        """Torque against the motion whose power is `relative` times |tau qd|, [T, axes] Nm."""
        tau = situation.tau_rigid + situation.tau_friction
        return self["relative"] * np.abs(tau) * direction(situation.motion.qd) * self._axis_gate(situation)
