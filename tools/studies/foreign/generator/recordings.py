"""Files of a session as a plant engineer gets them: power rows of the meter and logs of the controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from tools.studies.foreign.generator import meter
from tools.studies.foreign.generator.arm import Floats
from tools.studies.foreign.generator.hidden.effect import Dose
from tools.studies.foreign.generator.motion import STEP_S
from tools.studies.foreign.generator.plant import Flow, Session, flow

_LOG_EVERY = 2
"""Rows of the simulation per row of the log."""
_ANGLE_NOISE_RAD = 2e-5
_TORQUE_NOISE = 0.004
"""Share of the rated torque."""
_CURRENT_NOISE_A = 0.03
_MARGIN_S = 4.0
"""Power rows before and after each recording."""


@dataclass(frozen=True, slots=True)
class Clock:
    """The controller's clock against the meter's."""

    ahead_s: float = 0.0
    drift_ppm: float = 0.0

    def read(self, t: Floats) -> Floats:
        """Readings at true times [T] s since the session's start, since the same origin."""
        return np.asarray(t + self.ahead_s + 1e-6 * self.drift_ppm * t)


def write(
    session: Session, doses: Sequence[Dose], folder: Path, start_s: float, clock: Clock, *, torques: bool,
    random: np.random.Generator,
) -> Flow:  # fmt: skip
    """Write `power.csv` and `logs/`; `start_s`: Unix time of the session's start."""
    (folder / "logs").mkdir(parents=True)
    shown = flow(session, doses)
    _write_power(session, shown, folder / "power.csv", start_s, random)
    columns = _log_columns(session, shown, torques=torques, random=random)
    for number, rows in enumerate(session.motion.recordings):
        taken = slice(rows.start, rows.stop, _LOG_EVERY)
        stamps = clock.read(session.motion.t[taken]) + start_s + random.normal(0, 1e-4, len(session.motion.t[taken]))
        table = {"time": np.round(stamps, 5)} | {name: values[taken] for name, values in columns.items()}
        csv.write_csv(pa.table(table), folder / "logs" / f"{log_name(number)}.csv")
    return shown


def _write_power(session: Session, shown: Flow, path: Path, start_s: float, random: np.random.Generator) -> None:
    """Rows near recordings; a row's time is its window's start."""
    site = session.plant.site
    power = site.read(shown.power + meter.noise(len(shown.power), random), random)
    begins = meter.WINDOW_S * np.arange(len(power)) - STEP_S / 2  # a row of the simulation stands in its step's middle
    near = np.zeros(len(power), bool)
    for rows in session.motion.recordings:
        near |= (begins > rows.start * STEP_S - _MARGIN_S) & (begins < rows.stop * STEP_S + _MARGIN_S)
    near &= ~site.missing(len(power), random)
    stamps = np.round((start_s + begins[near]) * 1e9 / 1e5).astype(np.int64) * 100_000
    table = {"time": stamps, "P": np.round(power[near], 3), "Vrms": np.round(shown.volts[near], 3)}
    csv.write_csv(pa.table(table), path)


def _log_columns(session: Session, shown: Flow, *, torques: bool, random: np.random.Generator) -> dict[str, Floats]:
    """Angles, then torques behind the gears (7 axes) and motor currents, then signals."""
    arm = session.plant.arm
    q = session.motion.q + random.normal(0, _ANGLE_NOISE_RAD, session.motion.q.shape)
    columns = _numbered("q", np.round(q, 6))
    if torques:
        noise = random.normal(0, 1, q.shape)
        if arm.joints > 6:
            columns |= _numbered("tau", np.round(shown.joint + _TORQUE_NOISE * arm.torque * noise, 4))
        current = shown.motor / arm.torque_per_ampere
        columns |= _numbered("current", np.round(current + random.normal(0, _CURRENT_NOISE_A, q.shape), 4))
    if session.plant.signals:
        columns |= {"brake": session.brake, "tool": session.tool}
    return columns


def _numbered(name: str, values: Floats) -> dict[str, Floats]:
    return {f"{name}{axis + 1}": np.ascontiguousarray(column) for axis, column in enumerate(values.T)}


def log_name(number: int) -> str:
    """cycle-aa, cycle-ab ...: names that nothing can mistake for executions of one trajectory."""
    return "cycle-" + "".join(chr(ord("a") + digit) for digit in divmod(number, 26))
