"""Gears that are worse than those that the plant began with."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.lab.motion.controller import RATE
from acqd.lab.plant.mechanics import direction
from acqd.lab.plant.parameters import per_axis
from acqd.lab.plant.situation import Effect, Situation


def only_axis(axis: float, axes: int) -> Floats:
    """[axes] 1 at `axis` (from 1), or everywhere for 0."""
    if axis == 0:
        return np.ones(axes)
    chosen = np.zeros(axes)
    chosen[int(np.clip(axis, 1, axes)) - 1] = 1.0
    return chosen


class _Friction(Effect):
    def _where(self, situation: Situation) -> Floats:
        """[T, axes]: the gate, on the chosen axes."""
        return self.gate(situation)[:, None] * only_axis(self["axis"], situation.motion.q.shape[1])


class CoulombFriction(_Friction):
    """Dry friction rises: a misaligned or dry gear."""

    id = "coulomb_friction"
    summary = "dry friction rises by a share, on one axis or (axis=0) on all"
    strength = ("relative", "of the present dry friction")
    defaults: ClassVar = {"relative": 0.4, "axis": 0.0}
    limits: ClassVar = {"relative": (-1, 100), "axis": (0, 100)}

    def torque(self, situation: Situation) -> Floats:
        """Against the motion."""
        nominal = per_axis(situation.parameters.friction.coulomb_Nm)
        return self["relative"] * nominal * direction(situation.motion.qd) * self._where(situation)


class ViscousFriction(_Friction):
    """Friction in proportion to speed rises: the wrong grease."""

    id = "viscous_friction"
    summary = "viscous friction rises by a share, on one axis or (axis=0) on all"
    strength = ("relative", "of the present viscous friction")
    defaults: ClassVar = {"relative": 0.5, "axis": 0.0}
    limits: ClassVar = {"relative": (-1, 100), "axis": (0, 100)}

    def torque(self, situation: Situation) -> Floats:
        """Against the motion."""
        nominal = per_axis(situation.parameters.friction.viscous_Nms_rad)
        return self["relative"] * nominal * situation.motion.qd * self._where(situation)


class StribeckFriction(_Friction):
    """More friction near standstill."""

    id = "stribeck_friction"
    summary = "friction near standstill, dying out with speed (speed_rad_s)"
    strength = ("torque_Nm", "Nm")
    defaults: ClassVar = {"torque_Nm": 4.0, "speed_rad_s": 0.12, "axis": 0.0}
    limits: ClassVar = {"speed_rad_s": (1e-3, 10), "axis": (0, 100)}

    def torque(self, situation: Situation) -> Floats:
        """Against the motion."""
        qd = situation.motion.qd
        bump = np.exp(-((qd / self["speed_rad_s"]) ** 2)) * direction(qd)
        return self["torque_Nm"] * bump * self._where(situation)


class LoadDependentFriction(_Friction):
    """Friction in proportion to the torque that the gear transmits."""

    id = "load_dependent_friction"
    summary = "dry friction in proportion to the transmitted torque"
    strength = ("relative", "of the transmitted torque")
    defaults: ClassVar = {"relative": 0.12, "axis": 0.0}
    limits: ClassVar = {"relative": (0, 10), "axis": (0, 100)}

    def torque(self, situation: Situation) -> Floats:
        """Against the motion."""
        load = np.abs(situation.tau_rigid)
        return self["relative"] * load * direction(situation.motion.qd) * self._where(situation)


class ThermalFriction(_Friction):
    """A cold start: viscous friction that goes away while the arm works and comes back while it rests."""

    id = "thermal_friction"
    summary = "extra viscous friction of cold gears; time constant of warming up in minutes of motion"
    strength = ("relative", "of the warm viscous friction")
    defaults: ClassVar = {"relative": 0.8, "minutes": 25.0, "axis": 0.0}
    limits: ClassVar = {"relative": (-1, 100), "minutes": (0.01, 1e5), "axis": (0, 100)}

    def begin(self) -> None:
        """Cold."""
        self._warmth = 0.0

    def torque(self, situation: Situation) -> Floats:
        """Against the motion."""
        qd = situation.motion.qd
        moving = (np.abs(qd).max(axis=1) > 0) * self.gate(situation)  # cold when it begins
        keep = np.exp(-1 / (RATE * 60 * self["minutes"]))
        warmth, _ = lfilter([1 - keep], [1, -keep], moving, zi=[keep * self._warmth])
        self._warmth = float(warmth[-1])
        cold = self["relative"] * (1 - warmth)[:, None]
        return np.asarray(cold * per_axis(situation.parameters.friction.viscous_Nms_rad) * qd * self._where(situation))


class GearRipple(_Friction):
    """Torque that comes and goes with the gear's angle: an eccentric wave generator, a worn tooth."""

    id = "gear_ripple"
    summary = "torque periodic in one axis' angle (periods per turn)"
    strength = ("torque_Nm", "Nm")
    defaults: ClassVar = {"torque_Nm": 6.0, "axis": 2.0, "periods": 24.0}
    limits: ClassVar = {"axis": (0, 100), "periods": (0.1, 1e5)}

    def torque(self, situation: Situation) -> Floats:
        """Conservative: it helps as often as it hinders; the copper loss stays."""
        angle = situation.motion.q * self["periods"]
        return self["torque_Nm"] * np.sin(angle) * self._where(situation)


class MechanicalPower(_Friction):
    """A gear's efficiency falls: a share of the mechanical power is lost, whichever way it flows."""

    id = "mechanical_power"
    summary = "a share of the mechanical power through the gears is lost"
    strength = ("relative", "of the mechanical power")
    defaults: ClassVar = {"relative": 0.15, "axis": 0.0}
    limits: ClassVar = {"relative": (0, 10), "axis": (0, 100)}

    def torque(self, situation: Situation) -> Floats:
        """Against the motion, so that its power is the share of |tau qd|."""
        full = situation.tau_rigid + situation.tau_friction
        return self["relative"] * np.abs(full) * direction(situation.motion.qd) * self._where(situation)
