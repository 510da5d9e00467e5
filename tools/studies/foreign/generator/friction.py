"""Gear friction: Stribeck curve over tanh, a power of speed below one, a share of the load, and warm grease."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from tools.studies.foreign.generator.arm import Arm, Floats
from tools.studies.foreign.generator.motion import STEP_S

_WARM_SHARE = 0.15
"""Share of the viscous friction that a hot gear has lost."""
_WARM_TIME_S = 1500.0


@dataclass(frozen=True, slots=True)
class Friction:
    """Parameters of n joints."""

    dry: Floats
    """[n] Nm."""
    stick: Floats
    """[n], additional share of the dry friction near standstill."""
    stick_speed: Floats
    """[n] rad/s."""
    viscous: Floats
    """[n] Nm at 1 rad/s."""
    power: float
    """Exponent of the speed."""
    load_share: Floats
    """[n], share of the rigid-body torque."""
    sign_speed: float
    """rad/s within which the direction changes."""

    def torque(self, qd: Floats, load: Floats, warmth: float) -> Floats:
        """[T, n] Nm along the motion; load [T, n] Nm; warmth at the start from 0 (cold) to 1."""
        speed = np.abs(qd)
        way = np.tanh(qd / self.sign_speed)
        stick = self.stick * np.exp(-((speed / self.stick_speed) ** 1.3))
        dry = self.dry * (1 + stick) + self.load_share * np.abs(load)
        viscous = self.viscous * speed**self.power
        heat = (dry + viscous) * speed
        hot = _warmth(heat, warmth)
        return np.asarray(way * (dry + viscous * (1 - _WARM_SHARE * hot)))


def drawn(arm: Arm, random: np.random.Generator) -> Friction:
    """Friction of one arm."""
    n = arm.joints
    return Friction(
        dry=0.03 * arm.torque * random.uniform(0.7, 1.3, n),
        stick=random.uniform(0.1, 0.35, n),
        stick_speed=random.uniform(0.06, 0.15, n),
        viscous=0.04 * arm.torque * random.uniform(0.7, 1.3, n),
        power=float(random.uniform(0.7, 0.9)),
        load_share=random.uniform(0.01, 0.04, n),
        sign_speed=float(random.uniform(0.006, 0.015)),
    )


def direction(qd: Floats) -> Floats:
    """Direction of a hidden friction, smoothed within 0.01 rad/s."""
    return np.asarray(np.tanh(qd / 0.01))


def _warmth(heat: Floats, start: float) -> Floats:
    """[T, n] warmth behind a first-order lag of the friction's heat [T, n] W, 1 at the session's mean heat."""
    keep = float(np.exp(-STEP_S / _WARM_TIME_S))
    share = heat / np.maximum(heat.mean(axis=0), 1e-9)
    first = np.full((1, heat.shape[1]), start * keep)
    warm, _ = lfilter([1 - keep], [1.0, -keep], share, axis=0, zi=first)
    return np.asarray(warm)
