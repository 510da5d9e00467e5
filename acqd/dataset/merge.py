"""Merges one log with its power: one recording on a common time vector (thesis section 6.1)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.dataset.power import PowerStream
from acqd.dataset.resample import held, resampled
from acqd.dataset.schema import write_columns
from acqd.robot.labels import Texts
from acqd.robot.log import RobotLog, in_time
from acqd.robot.log_ends import unknown_ends

_POWER_GAP = 2.1  # windows to the nearest known one: up to three missing in a row are bridged
_LOG_GAP_S = 0.25  # angles are not interpolated over a longer gap between log rows


@dataclass(frozen=True, slots=True)
class Recording:
    """Power and motion in rows `step_s` apart."""

    name: str
    time_ns: NDArray[np.int64]
    """[T] UTC of the power clock, at the middle of each window."""
    columns: dict[str, Floats]
    """[T] each: P [W], Vrms [V], q1.. [rad] and whatever else was logged; NaN where unknown.

    A signal is the share of each row in which it is on: a meter's window sees no more of it.
    """
    valid: NDArray[np.bool_]
    """[T]: rows with both power and angles."""
    context: NDArray[np.bool_] | None = None
    """[T] rows whose angles alone may be used: of neighbouring pieces of a log, at its ends in motion, without power.

    None if there are no such rows.
    """
    unknown_ends: int = 0
    """Rows at the ends of the motion whose accelerations are not known (see robot.log_ends)."""
    labels: dict[str, Texts] = field(default_factory=dict)
    """[T] each: program, step, part, state, where logged."""

    def of_axes(self, quantity: str, axes: int) -> Floats:
        """[T, axes] of a quantity of every axis, such as "q". Raises KeyError for one that was not logged."""
        return np.column_stack([self.columns[f"{quantity}{axis + 1}"] for axis in range(axes)])

    def write(self, folder: Path, sliding: tuple[int, ...] = ()) -> None:
        """Write `NAME.parquet`; `sliding` are the prismatic joints, from 0, whose units are others. Raises OSError."""
        flags = {"valid": self.valid} if self.context is None else {"valid": self.valid, "context": self.context}
        columns = {**self.columns, **self.labels, **flags}
        write_columns(folder / f"{self.name}.parquet", self.time_ns, columns, sliding)


def merge(name: str, log: RobotLog, power: PowerStream, lag_s: float, drift_ppm: float, step_s: float) -> Recording:
    """Power and log, resampled linearly to rows `step_s` apart; the faster of them is averaged over the step first.

    `lag_s` is controller clock minus power clock at the log's middle, `drift_ppm` how much the controller gains.
    """
    controller, rows = in_time(log)
    middle = (controller[0] + controller[-1]) / 2
    clock = controller - lag_s - (controller - middle) * drift_ppm * 1e-6  # power clock
    half_ns = power.window_ns // 2
    part = power.part(round(clock[0] * 1e9) - half_ns, round(clock[-1] * 1e9) - half_ns)
    centres: Floats = np.asarray((power.time_ns[part] + half_ns) * 1e-9, dtype=np.float64)
    count = int((centres[-1] - centres[0]) / step_s + 1e-6) + 1 if len(centres) else 0
    grid: Floats = np.asarray((centres[0] if count else clock[0]) + step_s * np.arange(count), dtype=np.float64)
    P, volts = np.asarray(power.P[part]), np.asarray(power.Vrms[part])
    columns = {"P": resampled(grid, centres, P, step_s), "Vrms": resampled(grid, centres, volts, step_s)}
    for quantity in ("q", "qd", "tau", "current", "temperature"):
        values = getattr(log, quantity)
        if values is not None:
            for axis in range(values.shape[1]):
                columns[f"{quantity}{axis + 1}"] = resampled(grid, clock, values[rows, axis], step_s)
    for signal, values in log.signals.items():
        columns[signal] = resampled(grid, clock, values[rows], step_s)
    labels = {name: held(grid, clock, texts[rows]) for name, texts in log.labels.items()}
    logged = _near(grid, clock, _LOG_GAP_S / 2)
    valid = logged & _near(grid, centres[np.isfinite(P)], _POWER_GAP * power.window_ns * 1e-9)
    valid &= np.isfinite(columns["P"])
    if log.core is not None:
        start, end = np.interp(log.core, controller, clock)
        valid &= (grid >= start) & (grid < end)
    q = np.column_stack([columns[f"q{axis + 1}"] for axis in range(log.q.shape[1])])
    ends = valid & unknown_ends(q, logged, step_s)
    valid &= ~ends
    context = logged & ~valid
    first_ns = int(power.time_ns[part][0]) + half_ns if count else 0
    time_ns = first_ns + np.rint(step_s * 1e9 * np.arange(count)).astype(np.int64)
    return Recording(name, time_ns, columns, valid, context if context.any() else None, int(ends.sum()), labels)


def _near(grid: Floats, t: Floats, within_s: float) -> NDArray[np.bool_]:
    """Whether a time of `t` (rising) lies within `within_s` of each grid point."""
    if not len(t):
        return np.zeros(len(grid), bool)
    after = np.clip(np.searchsorted(t, grid), 1, len(t) - 1) if len(t) > 1 else np.zeros(len(grid), int)
    nearest = np.minimum(np.abs(t[after] - grid), np.abs(t[np.maximum(after - 1, 0)] - grid))
    return np.asarray(nearest <= within_s)
