"""Energy and cost per year of a power, at the duty of the recordings or another one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acqd import student
from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.models.noise_floor import STILL_RAD_S
from acqd.models.segments import Segment

HOURS_PER_YEAR = 8760.0
_CONFIDENCE = 0.975


@dataclass(frozen=True, slots=True)
class Duty:
    """How the robot works in a year, and what a kWh costs."""

    moving: float | None = None
    """Share of the year in which the robot moves; None: that of the recordings."""
    EUR_per_kWh: float | None = None
    """Mean price; None: unknown."""


@dataclass(frozen=True, slots=True)
class Yearly:
    """Energy and cost of a year, with 95 % intervals."""

    kWh: float
    half_kWh: float | None
    """Half width of the interval; None from a single recording."""
    duty: float
    """Share of the year in which the robot moves."""
    EUR_per_kWh: float | None
    recordings: int

    @property
    def EUR(self) -> float | None:  # noqa: N802
        """Cost."""
        return None if self.EUR_per_kWh is None else self.kWh * self.EUR_per_kWh

    @property
    def bounds(self) -> tuple[float, float] | None:
        """95 % interval in kWh."""
        return None if self.half_kWh is None else (self.kWh - self.half_kWh, self.kWh + self.half_kWh)

    def as_json(self) -> dict[str, Any]:
        """For reports."""
        bounds, price = self.bounds, self.EUR_per_kWh
        return {
            "kWh": self.kWh, "kWh_ci95": None if bounds is None else list(bounds), "EUR": self.EUR,
            "EUR_ci95": None if bounds is None or price is None else [each * price for each in bounds],
            "duty": self.duty, "EUR_per_kWh": price, "recordings": self.recordings,
        }  # fmt: skip


def moving_rows(segment: Segment, step_s: float) -> np.ndarray:
    """[T] True where a joint moves."""
    return np.asarray(np.abs(segment.motion(step_s)[1]).max(axis=1) >= STILL_RAD_S)


def require_duty(duty: Duty, moving: Sequence[np.ndarray], path: Path) -> None:
    """Raise UserError for a duty that recordings without rest, or without motion, cannot tell the energy of."""
    rows = np.concatenate(moving)
    if duty.moving is not None and (rows.all() or not rows.any()):
        state = "no rest" if rows.all() else "no motion"
        raise UserError(f"{path}: the recordings have {state}, so --duty {duty.moving:g} cannot be computed")


def yearly(
    recordings: Sequence[str], powers: Sequence[Floats], moving: Sequence[np.ndarray], duty: Duty, size_error: float = 0
) -> Yearly:
    """Energy per year of powers [T] W of pieces of recordings, from their means in motion and at rest.

    The interval is a delete-one jackknife over recordings (Efron and Stein 1981); `size_error`, the relative half width
    of the power's size, is added in quadrature. Another duty than that of the recordings needs rest and motion in them
    (see `require_duty`).
    """
    names = sorted(set(recordings))
    sums = np.zeros((len(names), 2, 2))  # recording, (rest, motion), (energy, rows)
    for name, power, moves in zip(recordings, powers, moving, strict=True):
        for state, rows in enumerate((~moves, moves)):
            sums[names.index(name), state] += power[rows].sum(), rows.sum()
    total = sums.sum(axis=0)
    share = float(total[1, 1] / total[:, 1].sum())
    given, wanted = duty.moving is not None, share if duty.moving is None else duty.moving

    def mean_power(of: Floats) -> float:
        if not given:
            return float(of[:, 0].sum() / of[:, 1].sum())
        rest, motion = of[:, 0] / of[:, 1]
        return float((1 - wanted) * rest + wanted * motion)

    kwh_per_W = HOURS_PER_YEAR / 1000.0
    value, half = mean_power(total), None
    without = total - sums
    if len(names) > 1 and (not given or without[:, :, 1].all()):
        each = np.array([mean_power(rest) for rest in without])
        error = float(np.sqrt((len(names) - 1) / len(names) * ((each - each.mean()) ** 2).sum()))
        half = float(np.hypot(float(student.ppf(_CONFIDENCE, len(names) - 1)) * error, size_error * value)) * kwh_per_W
    return Yearly(value * kwh_per_W, half, wanted, duty.EUR_per_kWh, len(names))
