"""Torques of the arm: rigid body with a changing payload, friction, and the gear temperature that follows from it."""

from __future__ import annotations

import itertools

import numpy as np

from acqd.arrays import Floats
from acqd.lab.plant.parameters import PlantParameters, per_axis
from acqd.motion.controller import RATE, Motion
from acqd.robot.arm import Arm, Payload
from acqd.robot.dynamics import inverse_dynamics, mechanical_energy

_REFERENCE_DEGC = 30.0
_SIGN_SPEED = 0.004  # rad/s, speed range in which friction changes its sign
PAYLOAD_CENTRE_M = 0.04
"""m from the flange on its axis: centre of mass of a payload."""


class RigidBody:
    """Rigid-body dynamics of the arm with its payload."""

    def __init__(self, arm: Arm) -> None:
        self._arm = arm
        self._rotor = np.array([joint.drive.rotor_inertia_kgm2 for joint in arm.description.joint])
        self._loaded: dict[float, Arm] = {0.0: arm}

    def arm(self, mass: float) -> Arm:
        """The arm with `mass` (kg) at its flange."""
        if mass not in self._loaded:
            self._loaded[mass] = Arm(self._arm.description, Payload(mass, (0.0, 0.0, PAYLOAD_CENTRE_M)))
        return self._loaded[mass]

    def torque(self, motion: Motion, mass: Floats) -> Floats:
        """Inverse dynamics, [T, axes] Nm, for payloads `mass` [T] (kg)."""
        tau = np.empty_like(motion.q)
        for first, last in _constant_runs(mass):
            tau[first:last] = _rigid_torque(self.arm(float(mass[first])), motion.part(first, last))
        return tau

    def rotor_torque(self, motion: Motion) -> Floats:
        """[T, axes] Nm that accelerate the rotors, at the output of the gears."""
        return np.asarray(motion.qdd * self._rotor)

    def energy(self, q: Floats, qd: Floats, mass: float) -> float:
        """Kinetic and potential energy (J) of arm, payload and rotors in one state `q`, `qd` [axes]."""
        rigid = float(mechanical_energy(self.arm(mass), q[None], qd[None])[0])
        return rigid + 0.5 * float(self._rotor @ (qd * qd))

    def payload_energy(self, motion: Motion, mass: Floats, before: float) -> float:
        """Energy (J) that payloads add when they are picked up, minus the energy that they remove when put down.

        `before` is the mass (kg) carried just before the motion.
        """
        total = 0.0
        carried = np.concatenate([[before], mass])
        for k in np.flatnonzero(np.diff(carried)):
            after = self.energy(motion.q[k], motion.qd[k], float(carried[k + 1]))
            total += after - self.energy(motion.q[k], motion.qd[k], float(carried[k]))
        return total


def _rigid_torque(arm: Arm, motion: Motion) -> Floats:
    """Inverse dynamics [T, axes] (Nm), computed only once per standstill."""
    moving = (motion.qd != 0).any(axis=1) | (motion.qdd != 0).any(axis=1)
    needed = moving.copy()
    needed[0] = True
    needed[1:] |= moving[:-1]
    rows = np.flatnonzero(needed)
    tau = inverse_dynamics(arm, motion.q[rows], motion.qd[rows], motion.qdd[rows])
    return np.asarray(tau[np.cumsum(needed) - 1])


def _constant_runs(values: Floats) -> list[tuple[int, int]]:
    """First index, and last index plus one, of every run of equal values."""
    edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    return list(itertools.pairwise(edges))


def direction(qd: Floats) -> Floats:
    """Sign of the speed, smoothed around standstill by a hyperbolic tangent."""
    return np.tanh(qd / _SIGN_SPEED)


class GearFriction:
    """Coulomb, Stribeck and viscous friction; viscous friction falls as the gears warm up."""

    def __init__(self, parameters: PlantParameters, start_degC: float | None = None) -> None:
        self._p = parameters
        friction, thermal = parameters.friction, parameters.thermal
        self._coulomb, self._viscous = per_axis(friction.coulomb_Nm), per_axis(friction.viscous_Nms_rad)
        self._stribeck = per_axis(friction.stribeck_Nm)
        self._capacity, self._resistance = per_axis(thermal.capacity_J_K), per_axis(thermal.resistance_K_W)
        start = _REFERENCE_DEGC if start_degC is None else start_degC
        self.temperature = np.full(len(self._coulomb), start)
        """[axes] degC at the end of the last call of `run`."""

    def run(self, qd: Floats, step: int = RATE) -> tuple[Floats, Floats]:
        """Friction torque (Nm) and gear temperature (degC), both [T, axes], for speeds [T, axes] (rad/s).

        The temperature changes slowly and is updated only every `step` samples.
        """
        sign = direction(qd)
        shape = np.exp(-((qd / self._p.friction.stribeck_speed_rad_s) ** 2))
        dry = sign * (self._coulomb + self._stribeck * shape)
        viscous = self._viscous * qd
        factor = np.empty_like(qd)
        temperature = np.empty_like(qd)
        for first in range(0, len(qd), step):
            part = slice(first, min(first + step, len(qd)))
            factor[part] = 1 + self._p.friction.viscous_per_K * (_REFERENCE_DEGC - self.temperature)
            temperature[part] = self.temperature
            seconds = (part.stop - first) / RATE
            heat = ((dry[part] + factor[first] * viscous[part]) * qd[part]).mean(axis=0)
            cooling = (self.temperature - self._p.thermal.ambient_degC) / self._resistance
            self.temperature = self.temperature + (heat - cooling) / self._capacity * seconds
        return dry + factor * viscous, temperature
