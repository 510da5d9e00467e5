"""The controller's DataRecorder (Listing 4.1): joint data on the controller's own, wrong clock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.lab.controller import RATE
from acqd.robot.description import Floats, LogColumns, RobotDescription


@dataclass(frozen=True, slots=True)
class ControllerClock:
    """How the controller's time follows from true time."""

    offset_s: float = 0.0
    """Controller minus UTC at the campaign's begin."""
    drift_ppm: float = 0.0
    """How much faster than UTC it runs."""
    origin_utc_ns: int = 0
    """The campaign's begin."""

    def reading(self, utc_s: Floats) -> Floats:
        """Controller time [s since the campaign's begin] at `utc_s` [s since the campaign's begin]."""
        return utc_s * (1 + self.drift_ppm * 1e-6) + self.offset_s


@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """How a log is taken."""

    period_s: float = 0.04
    """From 1 ms up; 40 ms in the thesis."""
    timeout_s: float = 400.0
    """Longest recording."""
    jitter_s: float = 0.0005
    """Standard deviation of when a sample is really taken."""
    missing: float = 0.0
    """Share of rows that are lost."""
    angle_noise_rad: float = 2e-6
    """RMS; resolution of the joint encoders."""
    torque_noise_Nm: float = 0.15
    """RMS of the joint torque sensors."""
    signals: bool = True
    """Record tool and brake signals too; the thesis' logs had none."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """What the recorder can see of a motion, at 1 kHz."""

    q: Floats
    """[T, axes] rad."""
    tau: Floats
    """[T, axes] Nm: torque sensors after the gear."""
    current: Floats
    """[T, axes] A: motor currents."""
    temperature: Floats
    """[T, axes] degC."""
    tool_on: Floats
    """[T] 0 or 1."""
    brake_open: Floats
    """[T] 0 or 1."""


def record(
    path: Path,
    robot: RobotDescription,
    seen: Recorded,
    begin_utc_s: float,
    clock: ControllerClock,
    settings: RecorderSettings,
    random: np.random.Generator,
) -> int:
    """Write one log; `begin_utc_s` is the true time of its first sample. Returns its number of rows."""
    seconds = min(len(seen.q) / RATE, settings.timeout_s)
    ideal = np.arange(int(seconds / settings.period_s)) * settings.period_s
    taken = np.clip(ideal + random.normal(0, settings.jitter_s, len(ideal)), 0, (len(seen.q) - 1) / RATE)
    stamp = clock.reading(begin_utc_s + np.maximum.accumulate(taken))
    kept = random.random(len(ideal)) >= settings.missing
    rows = Recorded(
        *(_at(values, taken) for values in (seen.q, seen.tau, seen.current, seen.temperature)),
        *(np.round(_at(values[:, None], taken)[:, 0]) for values in (seen.tool_on, seen.brake_open)),
    )
    q = rows.q + random.normal(0, settings.angle_noise_rad, rows.q.shape)
    tau = rows.tau + random.normal(0, settings.torque_noise_Nm, rows.tau.shape)
    layout = next((layout for layout in robot.log if layout.format == "datarecorder"), None)
    noisy = Recorded(q, tau, rows.current, rows.temperature, rows.tool_on, rows.brake_open)
    if layout is not None:
        _write_datarecorder(path, layout, noisy, stamp, kept, clock.origin_utc_ns, settings.signals)
    else:
        _write_csv(path, noisy, stamp, kept, clock.origin_utc_ns, settings.signals)
    return int(kept.sum())


def log_suffix(robot: RobotDescription) -> str:
    """File name ending of this robot's logs."""
    return ".log" if any(layout.format == "datarecorder" for layout in robot.log) else ".csv"


def _at(values: Floats, seconds: Floats) -> Floats:
    """Rows of 1 kHz `values` [T, n] at `seconds`, linear in between."""
    position = seconds * RATE
    before = np.minimum(position.astype(int), len(values) - 2)
    share = (position - before)[:, None]
    return values[before] * (1 - share) + values[before + 1] * share


def _write_datarecorder(
    path: Path, layout: LogColumns, rows: Recorded, stamp: Floats, kept: Floats, origin_ns: int, signals: bool
) -> None:
    """Whitespace separated, header after %, time as seconds and nanoseconds to the millisecond (thesis 4.2)."""
    axes = rows.q.shape[1]
    names = [layout.time_s or "", layout.time_ns or ""]
    names += [layout.q.format(k, k + 1) for k in range(axes)]
    columns = [rows.q]
    if layout.tau:
        names += [layout.tau.format(k, k + 1) for k in range(axes)]
        columns.append(rows.tau)
    for name, values in ((layout.tool, rows.tool_on), (layout.brake, rows.brake_open)):
        if name and signals:
            names.append(name)
            columns.append(values[:, None])
    table = np.concatenate(columns, axis=1)
    lines = ["% " + " ".join(names)]
    for k in np.flatnonzero(kept):
        ms = (origin_ns + round(stamp[k] * 1e9)) // 1_000_000
        values = " ".join(f"{value:.7g}" for value in table[k])
        lines.append(f"{ms // 1000} {ms % 1000 * 1_000_000} {values}")
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")


def _write_csv(path: Path, rows: Recorded, stamp: Floats, kept: Floats, origin_ns: int, signals: bool) -> None:
    """The generic header: time in Unix seconds, motor currents and temperatures instead of joint torques."""
    axes = rows.q.shape[1]
    names = ["time"]
    names += [f"{quantity}{k + 1}" for quantity in ("q", "current", "temperature") for k in range(axes)]
    table = np.concatenate([rows.q, rows.current, rows.temperature], axis=1)
    if signals:
        names += ["tool", "brake"]
        table = np.column_stack([table, rows.tool_on, rows.brake_open])
    lines = [",".join(names)]
    for k in np.flatnonzero(kept):
        us = (origin_ns + round(stamp[k] * 1e9)) // 1000
        values = ",".join(f"{value:.7g}" for value in table[k])
        lines.append(f"{us // 1_000_000}.{us % 1_000_000:06d},{values}")
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
