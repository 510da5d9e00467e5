"""The plant: joint motion in, demanded mains power and sensor readings out, energy accounted for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.lab.instruments.data_recorder import Recorded
from acqd.lab.motion.controller import Motion
from acqd.lab.plant.electrics import DcStorage, Motors, PowerSupply, Standby
from acqd.lab.plant.ledger import Ledger, row_sum
from acqd.lab.plant.mechanics import GearFriction, RigidBody
from acqd.lab.plant.parameters import PlantParameters
from acqd.lab.plant.situation import Effect, Situation, Stretch
from acqd.robot.arm import Arm


@dataclass(frozen=True, slots=True)
class PlantTrace:
    """One stretch of plant, at 1 kHz."""

    power: Floats
    """[T] W drawn from the mains."""
    recorded: Recorded
    """What the robot's recorder would log."""
    situation: Situation


class Plant:
    """One robot cell. Stretches of motion follow on each other without a gap; their state carries over."""

    def __init__(
        self,
        arm: Arm,
        parameters: PlantParameters,
        effects: Sequence[Effect] = (),
        start_degC: float | None = None,
        random: np.random.Generator | None = None,
        nominal_V: float = 230.0,
    ) -> None:
        """`arm` is the robot as it really is. `start_degC`: of all gears; None: 30, where most stay at work."""
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
        self._carried: float | None = None  # kg at the end of the stretch before
        self.ledger = Ledger()

    def run(self, motion: Motion, voltage: Floats, stretch: Stretch | None = None) -> PlantTrace:
        """The plant over one stretch of `motion` at mains `voltage` [T] (Vrms)."""
        s = Situation(stretch or Stretch(), motion, self._arm, self._p, voltage, self._nominal_V)
        mass = sum(self._asked(lambda effect: effect.payload(s)).values(), np.zeros(len(motion)))
        powers = _together(self._mechanics(s, mass), self._dc_side(s), self._mains_side(s))
        self._account(s, powers, mass)
        return PlantTrace(powers["supplied"], self._recorded(s), s)

    def _asked(self, hook: Callable[[Effect], Floats | None]) -> dict[str, Floats]:
        """What every effect adds at one hook, by its id."""
        answers: dict[str, Floats] = {}
        for effect in self._effects:
            added = hook(effect)
            if added is not None:
                answers[effect.id] = answers[effect.id] + added if effect.id in answers else added
        return answers

    def _mechanics(self, s: Situation, mass: Floats) -> dict[str, Floats]:
        """Torques, currents and joint power; returns the mechanical loss channels."""
        motion = s.motion
        s.tau_rigid = self._body.torque(motion, mass)
        s.tau_friction, self._temperature = self._friction.run(motion.qd)
        outside = self._asked(lambda effect: effect.external_torque(s))
        self._outside = sum(outside.values(), np.zeros_like(motion.q))
        inside = self._asked(lambda effect: effect.torque(s))
        torque = s.tau_rigid + self._body.rotor_torque(motion) + s.tau_friction + self._outside
        torque = torque + sum(inside.values(), np.zeros_like(motion.q))
        torque = torque * motion.brake_open[:, None]  # a closed brake holds the arm, not the motor
        s.current = self._motors.current(torque)
        s.joint_power = torque * motion.qd + self._motors.copper_loss(s.current)
        powers = {
            "friction": row_sum(s.tau_friction * motion.qd),
            "copper": row_sum(self._motors.copper_loss(s.current)),
        }
        acting = _together(outside, inside)
        return powers | {name: row_sum(tau * motion.qd) for name, tau in acting.items()}

    def _dc_side(self, s: Situation) -> dict[str, Floats]:
        enabled = s.motion.brake_open.astype(float)
        inverters = self._motors.inverter_loss(s.current, s.joint_power, enabled)
        electronics = np.full(len(s.motion), self._p.dc_link.electronics_W)
        loads = self._asked(lambda effect: effect.dc_load(s))
        net = row_sum(s.joint_power) + inverters + electronics + sum(loads.values(), np.zeros(len(s.motion)))
        s.dc_power, chopper, stored = self._storage.run(net)
        self._stored_in_link = stored
        return {"inverters": inverters, "electronics": electronics, "chopper": chopper, **loads}

    def _mains_side(self, s: Situation) -> dict[str, Floats]:
        loss = self._supply.loss(s.dc_power)
        controller = self._standby.run(len(s.motion))
        s.mains_power = s.dc_power + loss + controller
        loads = self._asked(lambda effect: effect.mains_load(s))
        demand = s.mains_power + sum(loads.values(), np.zeros(len(s.motion)))
        return {"supplied": self._supply.lagged(demand), "supply": loss, "controller": controller, **loads}

    def _account(self, s: Situation, powers: dict[str, Floats], mass: Floats) -> None:
        """Where the stretch's energy went. The same effect may act at several hooks: then under one name."""
        motion = s.motion
        if self._carried is None:
            self._carried = float(mass[0])
            first = self._body.energy(motion.q[0], motion.qd[0], float(mass[0]))
            self.ledger.stored(first - self._p.supply.lag_s * float(powers["supplied"][0]))
        self.ledger.brought_in(self._body.handed_over(motion, mass, self._carried))
        self._carried = float(mass[-1])
        self.ledger.add(powers)
        last = self._body.energy(motion.q[-1], motion.qd[-1], float(mass[-1]))
        self.ledger.stored(last + self._storage.energy + self._supply.stored)

    def _recorded(self, s: Situation) -> Recorded:
        motion = s.motion
        recorded = Recorded(
            motion.q,
            s.tau_rigid + self._outside,
            s.current,
            self._temperature,
            motion.tool_on.astype(float),
            motion.brake_open.astype(float),
        )
        for effect in self._effects:
            recorded = effect.logged(recorded, s)
        return recorded


def _together(*parts: dict[str, Floats]) -> dict[str, Floats]:
    """Sums by name: an effect may act at several hooks, and has one channel."""
    total: dict[str, Floats] = {}
    for part in parts:
        for name, values in part.items():
            total[name] = total[name] + values if name in total else values
    return total
