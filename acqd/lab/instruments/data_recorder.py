"""The controller's DataRecorder (thesis, Listing 4.1): joint data, stamped by the controller's inaccurate clock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.atomic import naming
from acqd.motion.controller import RATE
from acqd.robot.description import LogColumns, RobotDescription


@dataclass(frozen=True, slots=True)
class ControllerClock:
    """A clock with constant offset and rate error."""

    offset_s: float = 0.0
    """Controller minus UTC at the start of the campaign."""
    drift_ppm: float = 0.0
    """Rate of the controller's clock minus the rate of UTC."""
    origin_utc_ns: int = 0
    """UTC of the start of the campaign."""

    def reading(self, utc_s: Floats) -> Floats:
        """Time on the controller's clock at the true time `utc_s`; both in s since the start of the campaign."""
        return utc_s * (1 + self.drift_ppm * 1e-6) + self.offset_s


@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """Sampling and sensor noise of a log."""

    period_s: float = 0.04
    """At least 1 ms; 40 ms in the thesis."""
    timeout_s: float = 400.0
    """The recorder stops after this time."""
    jitter_s: float = 0.0005
    """Standard deviation of the sampling instants; limited to an eighth of the period."""
    missing: float = 0.0
    """Share of lost rows."""
    angle_noise_rad: float = 2e-6
    """RMS, from the resolution of the joint encoders."""
    torque_noise_Nm: float = 0.15
    """RMS of the joint torque sensors."""
    torque_scale: float = 1.0
    """Logged torques over the true ones: an error of the sensors' calibration."""
    signals: bool = True
    """Record tool and brake signals as well; the logs of the thesis had none."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """The signals available to the recorder, at 1 kHz."""

    q: Floats
    """[T, axes] rad."""
    tau: Floats
    """[T, axes] Nm, from torque sensors after the gear."""
    current: Floats
    """[T, axes] A of the motors."""
    temperature: Floats
    """[T, axes] degC."""
    tool_on: Floats
    """[T] 0 or 1."""
    brake_open: Floats
    """[T] 0 or 1."""


def record(
    path: Path,
    robot: RobotDescription,
    signals: Recorded,
    start_s: float,
    clock: ControllerClock,
    settings: RecorderSettings,
    random: np.random.Generator,
) -> int:
    """Write one log and return its number of rows.

    `start_s` is the true time of the first sample, in s since the start of the campaign.
    """
    seconds = min(len(signals.q) / RATE, settings.timeout_s)
    ideal = np.arange(int(seconds / settings.period_s)) * settings.period_s
    jitter_s = min(settings.jitter_s, settings.period_s / 8)  # a late sample must not overtake the next
    taken = np.clip(ideal + random.normal(0, jitter_s, len(ideal)), 0, (len(signals.q) - 1) / RATE)
    taken = np.maximum.accumulate(taken)[random.random(len(ideal)) >= settings.missing]
    stamps = [clock.origin_utc_ns + round(s * 1e9) for s in clock.reading(start_s + taken).tolist()]
    q, tau, current, temperature = (
        _at(values, taken) for values in (signals.q, signals.tau, signals.current, signals.temperature)
    )
    q += random.normal(0, settings.angle_noise_rad, q.shape)
    tau = settings.torque_scale * tau + random.normal(0, settings.torque_noise_Nm, tau.shape)
    tool, brake = (np.round(_at(switch[:, None], taken)) for switch in (signals.tool_on, signals.brake_open))
    layout = next((layout for layout in robot.log if layout.format == "datarecorder"), None)
    if layout is not None:
        columns = {layout.q: q, layout.tau: tau}
        switches = {layout.tool: tool, layout.brake: brake}
        _write_datarecorder(path, layout, columns | (switches if settings.signals else {}), stamps)
    else:
        logged = {"q{1}": q, "current{1}": current, "temperature{1}": temperature}
        _write_csv(path, logged | ({"tool": tool, "brake": brake} if settings.signals else {}), stamps)
    return len(stamps)


def log_suffix(robot: RobotDescription) -> str:
    """File name ending of this robot's logs."""
    return ".log" if any(layout.format == "datarecorder" for layout in robot.log) else ".csv"


def _at(values: Floats, seconds: Floats) -> Floats:
    """1 kHz `values` [T, n] at `seconds`, linearly interpolated."""
    position = seconds * RATE
    before = np.minimum(position.astype(int), len(values) - 2)
    share = (position - before)[:, None]
    return np.asarray(values[before] * (1 - share) + values[before + 1] * share)


def _write_datarecorder(
    path: Path, layout: LogColumns, columns: dict[str | None, Floats], stamps_ns: list[int]
) -> None:
    """Columns separated by spaces, header after %, time as seconds and nanoseconds with 1 ms steps (thesis 4.2)."""
    names, table = _table({name: values for name, values in columns.items() if name})
    lines = [" ".join(["%", str(layout.time_s), str(layout.time_ns), *names])]
    ms = 0
    for stamp, row in zip(stamps_ns, table.tolist(), strict=True):
        ms = max(stamp // 1_000_000, ms + 1)  # no millisecond is repeated
        lines.append(f"{ms // 1000} {ms % 1000 * 1_000_000} " + " ".join([f"{value:.7g}" for value in row]))
    with naming(path):
        path.write_text("\n".join([*lines, ""]), encoding="utf-8")


def _write_csv(path: Path, columns: dict[str, Floats], stamps_ns: list[int]) -> None:
    """Generic CSV: time in Unix seconds, motor currents and temperatures instead of joint torques."""
    names, table = _table(columns)
    lines = [",".join(["time", *names])]
    for stamp, row in zip(stamps_ns, table.tolist(), strict=True):
        us = stamp // 1000
        lines.append(f"{us // 1_000_000}.{us % 1_000_000:06d}," + ",".join([f"{value:.7g}" for value in row]))
    with naming(path):
        path.write_text("\n".join([*lines, ""]), encoding="utf-8")


def _table(columns: dict[str, Floats]) -> tuple[list[str], Floats]:
    """Column names and values; {0} and {1} in a name become axis numbers from 0 and from 1."""
    names = [name.format(k, k + 1) for name, values in columns.items() for k in range(values.shape[1])]
    return names, np.concatenate(list(columns.values()), axis=1)
