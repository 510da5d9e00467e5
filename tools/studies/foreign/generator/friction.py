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
    laws: tuple[str, ...] = ()
    """[n] of `_LAWS`: what each joint has besides; empty: nothing."""

    def torque(self, q: Floats, qd: Floats, load: Floats, warmth: float) -> Floats:
        """[T, n] Nm along the motion; load [T, n] Nm; warmth at the start from 0 (cold) to 1."""
        speed = np.abs(qd)
        way = np.tanh(qd / self.sign_speed)
        stick = self.stick * np.exp(-((speed / self.stick_speed) ** 1.3))
        dry = self.dry * (1 + stick) + self.load_share * np.abs(load)
        viscous = self.viscous * speed**self.power
        for joint, law in enumerate(self.laws):
            dry[:, joint] *= 1 + 0.3 * _besides(law, q[:, joint], qd[:, joint])
        heat = (dry + viscous) * speed
        hot = _warmth(heat, warmth)
        return np.asarray(way * (dry + viscous * (1 - _WARM_SHARE * hot)))


_LAWS = ("", "cubic", "logarithmic", "asymmetric", "angle")


def _besides(law: str, q: Floats, qd: Floats) -> Floats:
    """[T] what a law adds to the dry friction, at an angle [T] rad and a speed [T] rad/s."""
    if law == "cubic":
        return np.asarray(np.minimum(np.abs(qd) ** 3, 3.0))
    if law == "logarithmic":
        return np.asarray(np.log1p(np.abs(qd) / 0.05) / 3)
    if law == "asymmetric":
        return np.asarray(np.tanh(qd / 0.01))
    return np.sin(2 * q + 0.5) if law == "angle" else np.zeros(len(q))


def drawn(arm: Arm, random: np.random.Generator, *, mixed: bool = False) -> Friction:
    """Friction of one arm; `mixed`: another law in every joint."""
    n = arm.joints
    return Friction(
        dry=0.03 * arm.torque * random.uniform(0.7, 1.3, n),
        stick=random.uniform(0.1, 0.35, n),
        stick_speed=random.uniform(0.06, 0.15, n),
        viscous=0.04 * arm.torque * random.uniform(0.7, 1.3, n),
        power=float(random.uniform(0.7, 0.9)),
        load_share=random.uniform(0.01, 0.04, n),
        sign_speed=float(random.uniform(0.006, 0.015)),
        laws=tuple(random.choice(_LAWS, n).tolist()) if mixed else (),
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
