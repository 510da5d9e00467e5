"""A plant and a session on it: from motion and hidden effects to what the mains deliver and the joints show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tools.studies.foreign.generator import friction, meter, site, supply
from tools.studies.foreign.generator.arm import Arm, Floats, described, true_arm
from tools.studies.foreign.generator.dynamics import joint_torques
from tools.studies.foreign.generator.hidden.effect import Dose
from tools.studies.foreign.generator.motion import STEP_S, Motion, Plan, session

_BOOT_KEY = 6151
"""Distinguishes the random numbers of plants from the sessions' numbers."""


@dataclass(frozen=True, slots=True)
class Plant:
    """One true arm with its friction, drives and supply."""

    arm: Arm
    friction: friction.Friction
    supply: supply.Supply
    signals: bool
    """The controller logs brakes and tool; without them the brakes stay open."""
    site: site.Site

    @classmethod
    def drawn(cls, robot: str, seed: int, *, signals: bool, harsh: bool = False) -> Plant:
        """The plant of a seed, at a kind site or a harsh one."""
        random = np.random.default_rng([seed, _BOOT_KEY])
        arm = true_arm(described(robot), random)
        own_site = site.drawn(random) if harsh else site.Site()
        rubbing, feeding = friction.drawn(arm, random, mixed=own_site.mixed_friction), supply.drawn(arm, random)
        if own_site.capacitor:
            feeding = replace(feeding, lowest_W=feeding.control_W)
        return cls(own_site.arm(arm, random), rubbing, feeding, signals, own_site)


@dataclass(frozen=True, slots=True)
class Session:
    """What happens at T rows of a session, apart from hidden effects."""

    plant: Plant
    motion: Motion
    rigid: Floats
    """[T, n] Nm."""
    friction: Floats
    """[T, n] Nm."""
    brake: Floats
    """[T] 1 while the brakes are open."""
    tool: Floats
    """[T] 1 while the tool is on."""
    volts: Floats
    """[T] V."""
    others: Floats
    """[T] W of other loads on the meter."""

    @classmethod
    def drawn(cls, plant: Plant, plan: Plan, random: np.random.Generator) -> Session:
        """A session with its own moves, tool, voltage and other loads."""
        return cls.along(plant, session(plant.arm, plan, random), random)

    @classmethod
    def along(cls, plant: Plant, motion: Motion, random: np.random.Generator) -> Session:
        """A session of a motion, with its own tool, voltage and other loads."""
        rigid = joint_torques(plant.arm, plant.arm.bodies, motion.q, motion.qd, motion.qdd)
        warm = float(random.uniform(0.9, 1.0))
        rubbing = plant.friction.torque(motion.q, motion.qd, rigid, warm)
        brake = 1.0 - motion.resting if plant.signals else np.ones(len(motion.t))
        tool = _toggling(motion.t, random) * brake if plant.signals else np.zeros(len(motion.t))
        volts = meter.voltage(motion.t, random)
        others = plant.site.load(len(motion.t), random)
        return cls(plant, motion, rigid, rubbing, brake, tool, volts, others)

    def base_torque(self) -> Floats:
        """[T, n] Nm of the motors without hidden effects, at the gears' output."""
        return np.asarray(self.rigid + self.friction + self.plant.arm.rotor * self.motion.qdd)


@dataclass(frozen=True, slots=True)
class Flow:
    """Result of a session with some hidden effects."""

    motor: Floats
    """[T, n] Nm of the motors at the gears' output."""
    joint: Floats
    """[T, n] Nm that sensors behind the gears show."""
    power: Floats
    """[W] W in windows of the meter, without its noise."""
    volts: Floats
    """[W] V in windows of the meter."""


def flow(session: Session, doses: Sequence[Dose]) -> Flow:
    """Power and torques of a session with the hidden effects in their sizes."""
    plant = session.plant
    motor, joint = _torques(session, doses)
    drives = session.brake * plant.supply.joint_power(plant.arm, motor, session.motion.qd)
    for dose in doses:
        if dose.effect.drives is not None:
            drives = drives + session.brake * dose.effect.drives(motor, drives, dose.size)
    mains = plant.supply.lagged(plant.supply.mains(drives + plant.supply.control_W))
    late = np.arange(len(mains)) - plant.site.delay_s / STEP_S
    mains = np.interp(late, np.arange(len(mains)), mains) + session.others
    for dose in doses:
        if dose.effect.load is not None:
            mains = mains + dose.effect.load(drives, mains, dose.size)
    return Flow(motor, joint, *_metered(session, mains, doses))


def _torques(session: Session, doses: Sequence[Dose]) -> tuple[Floats, Floats]:
    """[T, n] Nm of the motors, which closed brakes relieve, and behind the gears."""
    motor, joint = session.base_torque(), session.rigid
    for dose in doses:
        if dose.effect.torque is not None:
            motor = motor + dose.size * dose.effect.torque
            if dose.effect.behind_gear:
                joint = joint + dose.size * dose.effect.torque
    return motor * session.brake[:, None], joint


def _metered(session: Session, mains: Floats, doses: Sequence[Dose]) -> tuple[Floats, Floats]:
    """[W] W and V in windows of the meter, from the mains power [T] W."""
    for dose in doses:
        if dose.effect.late is not None:
            mains = np.interp(session.motion.t - dose.effect.late(dose.size), session.motion.t, mains)
    power, volts = meter.windows(mains), meter.windows(session.volts)
    for dose in doses:
        if dose.effect.meter is not None:
            power = dose.effect.meter(power, volts, dose.size)
    return power, volts


def _toggling(t: Floats, random: np.random.Generator) -> Floats:
    """[T] 0 or 1, with dwell times of 2 to 12 s."""
    ends = np.cumsum(random.uniform(2, 12, int(t[-1] / 2) + 2))
    return np.asarray(np.searchsorted(ends, t) % 2, dtype=np.float64)
