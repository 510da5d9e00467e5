"""A site that keeps to none of the assumptions that are easy to share with a method: what a plant stands on and beside.

On both sides of the change: another load that switches on the same meter, a gripper that no description has, another
law of friction in every joint, a supply that takes nothing back and delays besides its lag, a meter of coarse steps
whose gain drifts, holes in its rows. Between the sides: another programme, slower or faster, with other moves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tools.studies.foreign.generator import meter
from tools.studies.foreign.generator.arm import Arm, Body, Floats
from tools.studies.foreign.generator.motion import STEP_S, Plan

_OVERRIDES = ((0.2, 0.45), (0.3, 0.7), (0.6, 1.0))
"""Speeds of programmes, as shares of the joints' speeds."""


@dataclass(frozen=True, slots=True)
class Site:
    """Of one plant, or nothing of all that."""

    compressor_W: float = 0.0
    """Load that switches on the same meter, 0: none."""
    on_s: float = 20.0
    off_s: float = 60.0
    """Mean durations."""
    gripper_kg: float = 0.0
    """Body at the flange, 30 to 90 mm out, that no description has."""
    mixed_friction: bool = False
    delay_s: float = 0.0
    """Pure delay of the supply besides its lag."""
    capacitor: bool = False
    """Regenerated energy stays in the DC link; nothing flows back and nothing is burnt."""
    step_W: float = 0.0
    """Resolution of the meter."""
    gain_drift: float = 0.0
    """Deviation of the meter's gain in the course of an hour."""
    holes: float = 0.0
    """Holes per minute in the meter's rows."""
    programmes: tuple[tuple[float, float], tuple[float, float]] = ((0.2, 1.0), (0.2, 1.0))
    """Speeds before and after."""

    def plan(self, plan: Plan, *, after: bool) -> Plan:
        """The plan at this site's speeds."""
        return replace(plan, override=self.programmes[after])

    def arm(self, arm: Arm, random: np.random.Generator) -> Arm:
        """The arm with its gripper."""
        if not self.gripper_kg:
            return arm
        out = arm.flange + arm.flange_turn @ np.array([*random.normal(0, 0.01, 2), random.uniform(0.03, 0.09)])
        body = Body(arm.joints - 1, self.gripper_kg, out, np.eye(3) * self.gripper_kg * 0.04**2)
        return replace(arm, bodies=(*arm.bodies, body))

    def load(self, count: int, random: np.random.Generator) -> Floats:
        """[count] W of the other load."""
        if not self.compressor_W:
            return np.zeros(count)
        pairs = int(count * STEP_S / (self.on_s + self.off_s)) * 3 + 4
        dwells = np.stack([random.gamma(4, self.off_s / 4, pairs), random.gamma(4, self.on_s / 4, pairs)], axis=1)
        edges = np.cumsum(dwells.ravel()) - random.uniform(0, self.off_s)
        on = np.searchsorted(edges, STEP_S * np.arange(count)) % 2
        return np.asarray(self.compressor_W * on, dtype=np.float64)

    def read(self, power: Floats, random: np.random.Generator) -> Floats:
        """[W] W as the meter gives them."""
        if self.gain_drift:
            power = power * (1 + meter.walk(len(power), self.gain_drift, 900.0, meter.WINDOW_S, random))
        return np.asarray(np.round(power / self.step_W) * self.step_W) if self.step_W else power

    def missing(self, count: int, random: np.random.Generator) -> NDArray[np.bool_]:
        """[count] whether a row of the meter is missing."""
        lost = np.zeros(count, bool)
        for first in random.integers(0, count, random.poisson(self.holes * count * meter.WINDOW_S / 60)):
            lost[first : first + random.integers(1, 40)] = True
        return lost


def drawn(random: np.random.Generator) -> Site:
    """A harsh site; each property with a probability of its own."""

    def often(share: float, value: float) -> float:
        return float(value) if random.random() < share else 0.0

    before, after = random.choice(len(_OVERRIDES), 2, replace=False)
    return Site(
        compressor_W=often(0.5, random.uniform(4, 20)), on_s=float(random.uniform(8, 40)),
        off_s=float(random.uniform(20, 120)), gripper_kg=often(0.5, random.uniform(0.3, 1.5)),
        mixed_friction=bool(random.random() < 0.7), delay_s=often(0.5, random.uniform(0.004, 0.02)),
        capacitor=bool(random.random() < 0.4), step_W=often(0.4, random.choice([0.1, 0.5, 1.0])),
        gain_drift=often(0.4, random.uniform(0.001, 0.003)), holes=often(0.4, random.uniform(0.1, 0.5)),
        programmes=(_OVERRIDES[before], _OVERRIDES[after]),
    )  # fmt: skip
