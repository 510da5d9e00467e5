"""The plant: from joint motion to mains power and sensor readings, with an energy balance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.lab.instruments.data_recorder import Recorded
from acqd.lab.plant.electrics import DcStorage, Motors, PowerSupply, Standby
from acqd.lab.plant.ledger import Ledger, row_sum
from acqd.lab.plant.mechanics import GearFriction, RigidBody
from acqd.lab.plant.parameters import PlantParameters
from acqd.lab.plant.situation import Effect, Situation, Stretch
from acqd.motion.controller import Motion
from acqd.robot.arm import Arm


@dataclass(frozen=True, slots=True)
class PlantTrace:
    """Output of the plant for one stretch of motion, at 1 kHz."""

    power: Floats
    """[T] W drawn from the mains."""
    recorded: Recorded
    """Signals for the robot's recorder."""
    situation: Situation


class Plant:
    """The physics of one robot cell. Consecutive stretches of motion have no gap; the state carries over."""

    def __init__(
        self,
        arm: Arm,
        parameters: PlantParameters,
        effects: Sequence[Effect] = (),
        start_degC: float | None = None,
        random: np.random.Generator | None = None,
        nominal_V: float = 230.0,
    ) -> None:
        """`arm` is the true robot; `start_degC` is the first temperature of all gears, by default 30 degC."""
        self._nominal_V = nominal_V
        self._arm = arm
        self._p = parameters
        self._effects = list(effects)
        self._body = RigidBody(arm)
        self._friction = GearFriction(parameters, start_degC)
        self._motors = Motors([joint.drive for joint in arm.description.joint], parameters.drive)
        self._storage = DcStorage(parameters.dc_link)
        self._supply = PowerSupply(parameters.supply)
        self._standby = Standby(parameters.controller, random or np.random.default_rng(0))
        self._payload_kg: float | None = None  # at the end of the previous stretch
        self.ledger = Ledger()

    def run(self, motion: Motion, voltage: Floats, stretch: Stretch | None = None) -> PlantTrace:
        """Power and signals for one stretch of `motion` at mains `voltage` [T] (Vrms)."""
        s = Situation(stretch or Stretch(), motion, self._arm, self._p, voltage, self._nominal_V)
        mass = sum(self._contributions(lambda effect: effect.payload(s)).values(), np.zeros(len(motion)))
        powers = _sum_by_name(self._mechanics(s, mass), self._dc_side(s), self._mains_side(s))
        self._account(s, powers, mass)
        return PlantTrace(powers["supplied"], self._recorded(s), s)

    def _contributions(self, hook: Callable[[Effect], Floats | None]) -> dict[str, Floats]:
        """The sum of what effects add at one hook, by effect id."""
        total: dict[str, Floats] = {}
        for effect in self._effects:
            added = hook(effect)
            if added is not None:
                total[effect.id] = total[effect.id] + added if effect.id in total else added
        return total

    def _mechanics(self, s: Situation, mass: Floats) -> dict[str, Floats]:
        """Compute torques, currents and joint power; returns the power of the mechanical loss channels."""
        motion = s.motion
        s.tau_rigid = self._body.torque(motion, mass)
        s.tau_friction, self._temperature = self._friction.run(motion.qd)
        external = self._contributions(lambda effect: effect.external_torque(s))
        self._tau_external = sum(external.values(), np.zeros_like(motion.q))
        internal = self._contributions(lambda effect: effect.torque(s))
        torque = s.tau_rigid + self._body.rotor_torque(motion) + s.tau_friction + self._tau_external
        torque = torque + sum(internal.values(), np.zeros_like(motion.q))
        torque = torque * motion.brake_open[:, None]  # a closed brake holds the arm, not the motor
        s.current = self._motors.current(torque)
        s.joint_power = torque * motion.qd + self._motors.copper_loss(s.current)
        powers = {
            "friction": row_sum(s.tau_friction * motion.qd),
            "copper": row_sum(self._motors.copper_loss(s.current)),
        }
        effects = _sum_by_name(external, internal)
        return powers | {name: row_sum(tau * motion.qd) for name, tau in effects.items()}

    def _dc_side(self, s: Situation) -> dict[str, Floats]:
        enabled = s.motion.brake_open.astype(float)
        inverters = self._motors.inverter_loss(s.current, s.joint_power, enabled)
        electronics = np.full(len(s.motion), self._p.dc_link.electronics_W)
        loads = self._contributions(lambda effect: effect.dc_load(s))
        net = row_sum(s.joint_power) + inverters + electronics + sum(loads.values(), np.zeros(len(s.motion)))
        s.dc_power, chopper, _ = self._storage.run(net)
        return {"inverters": inverters, "electronics": electronics, "chopper": chopper, **loads}

    def _mains_side(self, s: Situation) -> dict[str, Floats]:
        loss = self._supply.loss(s.dc_power)
        controller = self._standby.run(len(s.motion))
        s.mains_power = s.dc_power + loss + controller
        loads = self._contributions(lambda effect: effect.mains_load(s))
        demand = s.mains_power + sum(loads.values(), np.zeros(len(s.motion)))
        return {"supplied": self._supply.lagged(demand), "supply": loss, "controller": controller, **loads}

    def _account(self, s: Situation, powers: dict[str, Floats], mass: Floats) -> None:
        """Enter the energies of a stretch into the ledger."""
        motion = s.motion
        if self._payload_kg is None:
            self._payload_kg = float(mass[0])
            first = self._body.energy(motion.q[0], motion.qd[0], float(mass[0]))
            self.ledger.stored(first - self._p.supply.lag_s * float(powers["supplied"][0]))
        self.ledger.add_payload_energy(self._body.payload_energy(motion, mass, self._payload_kg))
        self._payload_kg = float(mass[-1])
        self.ledger.add(powers)
        last = self._body.energy(motion.q[-1], motion.qd[-1], float(mass[-1]))
        self.ledger.stored(last + self._storage.energy + self._supply.stored)

    def _recorded(self, s: Situation) -> Recorded:
        motion = s.motion
        recorded = Recorded(
            motion.q,
            s.tau_rigid + self._tau_external,
            s.current,
            self._temperature,
            motion.tool_on.astype(float),
            motion.brake_open.astype(float),
        )
        for effect in self._effects:
            recorded = effect.logged(recorded, s)
        return recorded


def _sum_by_name(*parts: dict[str, Floats]) -> dict[str, Floats]:
    """Values added up by name: an effect may act at several hooks but has one loss channel."""
    total: dict[str, Floats] = {}
    for part in parts:
        for name, values in part.items():
            total[name] = total[name] + values if name in total else values
    return total
