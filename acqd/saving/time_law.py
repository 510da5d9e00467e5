"""The time law of least energy along an unchanged path: when the arm is where, and not where it is.

A direct method (Betts, Practical Methods for Optimal Control, 2010, chapter 4): the pace, as the logarithm of new time
per old time, is a cubic spline over the old time. Its coefficients minimise the energy that the model predicts for the
drives in a given duration; what exceeds a limit is a penalty. The motion is smooth in the old time, and so is the pace,
so that the new motion has no steps of acceleration. A constant pace is plain uniform slowing (ADR 63).

With the pace, torques are known without any more dynamics: tau = g(q) + (tau_2 - pace' tau_1) / new time^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import minimize

from acqd.arrays import Floats
from acqd.motion.controller import RATE, Motion
from acqd.motion.limits import greatest_jerk
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inertial_parameters
from acqd.robot.newton_euler import Chain, joint_torque

_POINT_S, _FEWEST, _MOST = 0.02, 24, 400
"""Distance of the points at which power and limits are evaluated, s, and how many there are."""
_KNOT_S, _FEWEST_KNOTS, _MOST_KNOTS = 0.3, 5, 40
_BOUND = 1.2
"""Of the logarithm of the pace: a third to three times the mean pace."""
_PENALTY = 30.0
_ROUGHNESS = 1e-4
"""Of the energy, per squared coefficient: of laws that cost the same, the one nearest to uniform slowing."""
_ARGUMENTS = 3
"""Of power and limits at a point: the pace and its first two derivatives."""
_STEP = 1e-5
_STEPPED = np.eye(_ARGUMENTS, _ARGUMENTS + 1, 1)
"""[3, 4] which argument takes a step: none in the first of four evaluations at once, then one after another."""
_ITERATIONS = 40
_MARGIN = 0.95
"""Share of the limits up to which a law may go, between points that are 0.02 s apart."""
_BETWEEN = 2e-3
"""Excess that the margin covers."""
_ROUNDING = 1 + 1e-6
"""A log's own peaks may be the limits: what is written and read again differs by this."""
_RELIEF = (1.0, 0.8, 0.6, 0.4, 0.2, 0.0)
"""Shares of a law that exceeds a limit which are tried in turn; 0 is uniform slowing."""


class Drives(Protocol):
    """What a grey box says of single states of motion [T, axes]."""

    def rigid_torque(self, q: Floats, qd: Floats, qdd: Floats) -> Floats:
        """[T, axes] Nm."""
        ...

    def drive_power(self, tau: Floats, qd: Floats, qdd: Floats) -> Floats:
        """[T] W."""
        ...


@dataclass(frozen=True, slots=True)
class Bounds:
    """Limits of a robot's joints, each [axes]."""

    robot: RobotDescription
    speed: Floats
    acceleration: Floats
    jerk: Floats

    def rigid_torque(self, q: Floats, qd: Floats, qdd: Floats) -> Floats:
        """[T, axes] Nm of the described arm."""
        return joint_torque(Chain.of(self.robot), inertial_parameters(self.robot), q, qd, qdd)

    def widest(self, motion: Motion) -> list[Floats]:
        """Speed, acceleration, jerk and torque [axes] that a change of a motion may reach: the limit, or as before."""
        given = self.speed, self.acceleration, self.jerk, self.robot.effort
        return [np.maximum(limit, peak) for limit, peak in zip(given, self._peaks(motion), strict=True)]

    def keeps(self, motion: Motion, most: Sequence[Floats]) -> bool:
        """Whether a motion stays within such sizes."""
        return all((peak <= limit * _ROUNDING).all() for peak, limit in zip(self._peaks(motion), most, strict=True))

    def _peaks(self, motion: Motion) -> tuple[Floats, ...]:
        torque = self.rigid_torque(motion.q, motion.qd, motion.qdd)
        return *_peaks(motion), np.abs(torque).max(axis=0)


def _peaks(motion: Motion) -> tuple[Floats, ...]:
    """Greatest speed, acceleration and jerk [axes]."""
    return np.abs(motion.qd).max(axis=0), np.abs(motion.qdd).max(axis=0), greatest_jerk(motion)


@dataclass(frozen=True, slots=True)
class _Torques:
    """Torques of any law on a path: tau = still + (moved - pace' turned) / sigma^2, all [N, axes] Nm."""

    still: Floats
    moved: Floats
    turned: Floats

    @classmethod
    def of(cls, rigid: Drives | Bounds, q: Floats, q1: Floats, q2: Floats) -> _Torques:
        zero = np.zeros_like(q)
        still = rigid.rigid_torque(q, zero, zero)
        return cls(still, rigid.rigid_torque(q, q1, q2) - still, rigid.rigid_torque(q, zero, q1) - still)

    def at(self, sigma: Floats, turn: Floats) -> Floats:
        return self.still + (self.moved - turn * self.turned) / sigma**2


@dataclass(frozen=True, slots=True)
class _Points:
    """N points of a path: derivatives of the joints by the old time [N, axes], and torques."""

    q1: Floats
    q2: Floats
    q3: Floats
    model: _Torques
    described: _Torques

    def repeated(self, times: int) -> _Points:
        """The points one after another so many times."""

        def tiled(values: Floats) -> Floats:
            return np.tile(values, (times, 1))

        def torques(of: _Torques) -> _Torques:
            return _Torques(tiled(of.still), tiled(of.moved), tiled(of.turned))

        return _Points(tiled(self.q1), tiled(self.q2), tiled(self.q3), torques(self.model), torques(self.described))

    def power(self, drives: Drives, pace: Floats, turn: Floats) -> Floats:
        """[N] W of the drives."""
        sigma, turn = np.exp(pace)[:, None], turn[:, None]
        tau = self.model.at(sigma, turn)
        return drives.drive_power(tau, self.q1 / sigma, (self.q2 - self.q1 * turn) / sigma**2)

    def excess(self, limits: Sequence[Floats], pace: Floats, turn: Floats, bend: Floats) -> Floats:
        """[N] sum of the squares of what exceeds the limits, as shares of these."""
        s, a, b = np.exp(pace)[:, None], turn[:, None], bend[:, None]
        q1, q2 = self.q1, self.q2
        values = (
            q1 / s, (q2 - q1 * a) / s**2, (self.q3 - 3 * q2 * a - q1 * b + 2 * q1 * a**2) / s**3,
            self.described.at(s, a),
        )  # fmt: skip
        return np.asarray(
            sum(
                (np.maximum(np.abs(each) / limit - 1, 0.0) ** 2).sum(axis=1)
                for each, limit in zip(values, limits, strict=True)
            )
        )


class Path:
    """A stretch of motion with everything that its time laws need, at N points of the old time."""

    def __init__(self, motion: Motion, bounds: Bounds, drives: Drives) -> None:
        self.motion, self._drives = motion, drives
        count = int(np.clip(round(motion.seconds / _POINT_S), _FEWEST, _MOST))
        rows = np.unique(np.linspace(0, len(motion) - 1, count + 1).round().astype(int))
        u = rows / RATE
        self._u, self._weights = u, np.gradient(u) * np.where((u == u[0]) | (u == u[-1]), 0.5, 1.0)
        jerk = np.gradient(motion.qdd, 1 / RATE, axis=0)
        self.size = int(np.clip(round(motion.seconds / _KNOT_S) + 3, _FEWEST_KNOTS, _MOST_KNOTS))
        self._knots = np.concatenate([[u[0]] * 3, np.linspace(u[0], u[-1], self.size - 2), [u[-1]] * 3])
        functions = BSpline(self._knots, np.eye(self.size), 3)
        self._basis = [np.asarray(functions(u, order)) for order in range(3)]
        q, q1, q2, q3 = motion.q[rows], motion.qd[rows], motion.qdd[rows], jerk[rows]
        described = _Torques.of(bounds, q, q1, q2)
        self._points = _Points(q1, q2, q3, _Torques.of(drives, q, q1, q2), described)
        self._with_steps = self._points.repeated(_ARGUMENTS + 1)
        own = (q1, q2, q3, described.still + described.moved)
        given = (bounds.speed, bounds.acceleration, bounds.jerk, bounds.robot.effort)
        self._limits = [
            np.maximum(_MARGIN * limit, np.abs(values).max(axis=0)) for limit, values in zip(given, own, strict=True)
        ]
        self._whole = [np.maximum(limit, peak) for limit, peak in zip(given, _peaks(motion), strict=False)]

    @cached_property
    def uniform(self) -> Floats:
        """[K] the law of a constant pace."""
        return np.zeros(self.size)

    def energy(self, law: Floats, seconds: float) -> float:
        """J of the drives."""
        pace, turn, _ = self._at(law, seconds)
        return float(self._weights @ (self._points.power(self._drives, pace, turn) * np.exp(pace)))

    def keeps_limits(self, law: Floats, seconds: float) -> bool:
        """Whether a law keeps speed, acceleration, jerk and torque of every joint, also between the points."""
        new = self.motion_at(law, seconds)
        within = all((peak <= limit * _ROUNDING).all() for peak, limit in zip(_peaks(new), self._whole, strict=True))
        return within and bool(self._points.excess(self._limits, *self._at(law, seconds)).max() <= _BETWEEN)

    def best(self, seconds: float, start: Floats) -> Floats | None:
        """[K] the law of least energy of a duration, from a law to begin with; None where none keeps the limits."""
        scale = max(abs(self.energy(self.uniform, seconds)), 1.0)
        _, b1, b2 = self._basis

        def rows(pace: Floats, turn: Floats, bend: Floats) -> Floats:
            points, limits = self._with_steps, self._limits
            use = points.power(self._drives, pace, turn) * np.exp(pace) / scale
            return use + _PENALTY * points.excess(limits, pace, turn, bend)

        def cost(law: Floats) -> tuple[float, Floats]:
            at = self._at(law, seconds)
            shifted = (np.tile(values, (_ARGUMENTS + 1, 1)) for values in at)
            stepped = [values + _STEP * own[:, None] for values, own in zip(shifted, _STEPPED, strict=True)]
            now, *others = rows(*(values.ravel() for values in stepped)).reshape(_ARGUMENTS + 1, -1)
            slopes = [self._weights * (other - now) / _STEP for other in others]
            mean = self._weights * np.exp(at[0])
            gradient = self._basis[0].T @ (slopes[0] - slopes[0].sum() * mean / mean.sum())
            gradient += b1.T @ slopes[1] + b2.T @ slopes[2] + 2 * _ROUGHNESS * law
            return float(self._weights @ now + _ROUGHNESS * law @ law), gradient

        found = minimize(
            cost, start, jac=True, method="L-BFGS-B", bounds=[(-_BOUND, _BOUND)] * self.size,
            options={"maxiter": _ITERATIONS, "ftol": 1e-6},
        )  # fmt: skip
        kept = next((law for share in _RELIEF if self.keeps_limits(law := share * found.x, seconds)), None)
        if kept is None or self.energy(kept, seconds) <= self.energy(self.uniform, seconds):
            return kept
        return self.uniform if self.keeps_limits(self.uniform, seconds) else kept

    def unlike(self, law: Floats, seconds: float) -> float:
        """Mean square of the logarithm of the pace (see `Timing.unlike`)."""
        pace, _, _ = self._at(law, seconds)
        return float(self._weights @ pace**2 / self._weights.sum())

    def motion_at(self, law: Floats, seconds: float) -> Motion:
        """The stretch by a law, at 1 kHz."""
        old = self.motion
        fine = np.arange(len(old)) / RATE
        spline = BSpline(self._knots, law, 3)
        sigma, turn = np.exp(spline(fine)), spline(fine, 1)
        when = np.concatenate([[0.0], np.cumsum((sigma[1:] + sigma[:-1]) / 2)]) / RATE
        factor = (seconds - 1 / RATE) / max(float(when[-1]), 1e-9)
        rows = round(seconds * RATE)
        at = np.interp(np.arange(rows) / RATE, when * factor, fine) * RATE
        low = np.minimum(at, len(old) - 1).astype(int)
        high, part = np.minimum(low + 1, len(old) - 1), (at - low)[:, None]

        def there(values: Floats) -> Floats:
            return np.asarray(values[low] + part * (values[high] - values[low]))

        pace, bend = factor * there(sigma[:, None]), there(turn[:, None])
        qd, qdd = there(old.qd), there(old.qdd)
        return replace(
            old, q=there(old.q), qd=qd / pace, qdd=(qdd - qd * bend) / pace**2, brake_open=np.ones(rows, bool),
            tool_on=old.tool_on[low], phase=[""], phase_number=np.zeros(rows, np.int16),
        )  # fmt: skip

    def _at(self, law: Floats, seconds: float) -> tuple[Floats, Floats, Floats]:
        """[N] logarithm of the pace in a duration, and its first two derivatives by the old time."""
        pace, turn, bend = (basis @ law for basis in self._basis)
        return pace + np.log(seconds / float(self._weights @ np.exp(pace))), turn, bend
