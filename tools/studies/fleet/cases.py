"""The robots of the study: one type of arm, individual friction, drives and supply; hidden effects and their onsets."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tools.studies.foreign.generator import friction, supply
from tools.studies.foreign.generator.arm import Arm, Floats
from tools.studies.foreign.generator.dosing import dosed
from tools.studies.foreign.generator.hidden.catalogue import ALL
from tools.studies.foreign.generator.hidden.effect import Dose, Hidden
from tools.studies.foreign.generator.motion import Plan
from tools.studies.foreign.generator.plant import Plant, Session

TYPE = "iiwa7_r800"
OWN = ("payload", "coulomb_friction", "copper_loss", "gravity_bias", "supply_efficiency")
"""Effects of single robots, taken in turn."""
STRENGTHS = (0.03, 0.10)
"""Least and largest RMS of a hidden power while it acts, as a share of the dynamic range."""
_SHARED_ONSET = 1 / 3
"""Share of the time in question after which the shared cause sets in, at the same time for all."""


@dataclass(frozen=True, slots=True)
class Scale:
    """How large the study is."""

    robots: int
    minutes: float
    """In question, per robot."""
    reference: float
    """Minutes of recordings for the model, per robot."""
    hidden: int
    shared: int
    cause: str
    seed: int

    def plan(self, minutes: float) -> Plan:
        """Recordings of one or two minutes."""
        seconds = 120.0 if minutes > 20 else 60.0
        return Plan(max(round(60 * minutes / seconds), 5), seconds)


@dataclass(frozen=True, slots=True)
class Case:
    """One robot and its secret."""

    number: int
    cause: str | None
    shared: bool

    @property
    def name(self) -> str:
        """In the fleet's file."""
        return f"robot-{self.number:03d}"


def cases(scale: Scale) -> list[Case]:
    """All robots; those with hidden effects are drawn."""
    chosen = np.random.default_rng([scale.seed, 7]).permutation(scale.robots)[: scale.hidden].tolist()
    place = {number: k for k, number in enumerate(chosen)}
    found = []
    for number in range(scale.robots):
        k = place.get(number)
        shared = k is not None and k < scale.shared
        own = None if k is None else OWN[(k - scale.shared) % len(OWN)]
        found.append(Case(number, scale.cause if shared else own, shared))
    return found


def plant_of(scale: Scale, number: int) -> Plant:
    """A robot of the type: the same arm, windings within 5 %, friction within 20 %, its own cabinet."""
    kind = Plant.drawn(TYPE, scale.seed, signals=True)
    random = np.random.default_rng([scale.seed, 11, number])
    arm = replace(kind.arm, resistance=kind.arm.resistance * random.uniform(0.95, 1.05, kind.arm.joints))
    return replace(kind, arm=arm, friction=_own_friction(kind, arm, random), supply=_own_supply(kind.supply, random))


def _own_friction(kind: Plant, arm: Arm, random: np.random.Generator) -> friction.Friction:
    n, usual = arm.joints, kind.friction
    return replace(
        usual, dry=usual.dry * random.uniform(0.8, 1.2, n), viscous=usual.viscous * random.uniform(0.8, 1.2, n)
    )


def _own_supply(usual: supply.Supply, random: np.random.Generator) -> supply.Supply:
    return replace(
        usual, control_W=usual.control_W * float(random.uniform(0.9, 1.1)), cabinet_W=float(random.uniform(20, 45))
    )


@dataclass(frozen=True, slots=True)
class Secret:
    """What was hidden in a session."""

    doses: list[Dose]
    onset_s: float | None
    """Since the start of the session."""
    strength: float | None


def hidden_in(session: Session, case: Case, scale: Scale) -> Secret:
    """The effect of a case in its strength, from its onset on."""
    if case.cause is None:
        return Secret([], None, None)
    random = np.random.default_rng([scale.seed, 13, case.number])
    rows = session.motion.recordings
    first, last = session.motion.t[rows[0].start], session.motion.t[rows[-1].stop - 1]
    share = _SHARED_ONSET if case.shared else float(random.uniform(0.1, 0.5))
    onset_s = float(first + share * (last - first))
    dose, reached = dosed(session, ALL[case.cause](session, random), float(random.uniform(*STRENGTHS)))
    return Secret([Dose(begun(dose.effect, session.motion.t >= onset_s), dose.size)], onset_s, reached)


def begun(effect: Hidden, acts: np.ndarray) -> Hidden:
    """The effect at rows [T] where it `acts`."""
    mask = acts.astype(float)
    drives, load = effect.drives, effect.load
    torque = None if effect.torque is None else effect.torque * mask[:, None]

    def masked_drives(motor: Floats, power: Floats, size: float) -> Floats:
        assert drives is not None
        return np.asarray(drives(motor, power, size) * mask)

    def masked_load(power: Floats, mains: Floats, size: float) -> Floats:
        assert load is not None
        return np.asarray(load(power, mains, size) * mask)

    return replace(
        effect,
        torque=torque,
        drives=None if drives is None else masked_drives,
        load=None if load is None else masked_load,
    )
