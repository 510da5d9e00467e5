"""One robot log: placed in the metered power, predicted, compared."""

from __future__ import annotations

import hashlib
import logging
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import sqlalchemy as sa

from acqd.dataset.align import SEARCH_S, Lag
from acqd.dataset.clock_line import deviates, fit_line
from acqd.dataset.merge import Recording, merge
from acqd.dataset.placement import locate
from acqd.dataset.power import PowerStream, open_power
from acqd.dataset.regressors import explain
from acqd.discrepancy.monitor.baseline import baseline_of
from acqd.discrepancy.monitor.cusum import Monitor
from acqd.discrepancy.residual.delay import delay_of
from acqd.discrepancy.residual.errors import residuals, rms
from acqd.errors import InputError, UserError
from acqd.models.bundle.bundle import fingerprint
from acqd.models.bundle.envelope import Envelope
from acqd.models.bundle.restore import open_model
from acqd.models.metrics import predictions
from acqd.models.segments import Segment, segments_of
from acqd.robot.description import load_description
from acqd.robot.log import RobotLog, in_time, read_log
from acqd.sidecar.store import Done
from acqd.storage.schema import power
from acqd.timestamps import filetime, unix_s

_log = logging.getLogger(__name__)
_MARGIN_S = 5.0
_REMEMBERED = 30  # logs whose lags make the clock's line
_LEAST_COVERED = 0.75  # of a log's time by power rows
_NOTEWORTHY_GAP = 0.05
_PAUSE_S = 0.2
_LATEST_S, _LONGEST_S = 4e9, 6 * 3600.0
_SURE_LAG = "clock line"
_MOST_LATER_S = 0.1


class NoPowerYetError(Exception):
    """The database has no rows of a log's span, or not the last of them: the sink may be late."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Of a sidecar."""

    bundle: Path
    database: str
    device: str | None = None
    channel: str | None = None
    patience_s: float = 10.0
    """How long rows of a log's last moments may take to arrive in the database."""
    between_s: float = 200 * 3600.0
    """Recorded time that one false alarm may come in."""
    clocks_apart_s: float = 120.0
    """How far the robot's clock may be off."""


class Worker:
    """Takes logs one after the other. What it remembers is handed in and out, for the store to keep."""

    def __init__(self, settings: Settings, engine: sa.Engine) -> None:
        """Raises UserError, InputError."""
        self.settings, self._engine = settings, engine
        self.bundle, self.model = open_model(settings.bundle)
        self._robot = load_description(self.bundle.metadata["description"])
        self._envelope = Envelope.from_json(self.bundle.metadata["envelope"])
        self.monitor: Monitor | None = None
        self.notes: list[str] = []
        try:
            self.monitor = Monitor(baseline_of(settings.bundle, self.model, settings.between_s))
        except UserError as error:
            self.notes.append(f"no drift alarm: {error}")
        self._lags: list[tuple[float, float, float, float]] = []

    @property
    def name(self) -> str:
        """Of the model."""
        return str(self.bundle.metadata["name"])

    def restore(self, memory: Any) -> None:
        """Where an earlier sidecar with the same model stopped."""
        if not memory or memory.get("model") != self._identity():
            return
        try:
            self._lags = [(float(a), float(b), float(c), float(d)) for a, b, c, d in memory["lags"]]
            if self.monitor is not None and memory["monitor"]:
                self.monitor.restore(memory["monitor"])
        except (KeyError, ValueError, TypeError):
            _log.warning("what an earlier version remembered cannot be read: clock and drift begin anew")

    def memory(self) -> dict[str, Any]:
        """For `restore`."""
        monitor = None if self.monitor is None else self.monitor.as_json()
        return {"model": self._identity(), "lags": [list(each) for each in self._lags], "monitor": monitor}

    def _identity(self) -> str:
        return fingerprint(self.settings.bundle)

    def run(self, path: Path, name: str, sha256: str) -> Done:
        """Work through one file; what is wrong with it is told in the result.

        Raises NoPowerYetError when the rows of its span have not arrived: that is not the log's fault.
        """
        begun = time.monotonic()
        about: dict[str, Any] = {"log": name, "sha256": sha256, "model": self.name}
        try:
            done = self._predicted(path, name, sha256, about)
        except NoPowerYetError:
            raise
        except Exception as error:  # whatever is odd about one log must not stop those behind it
            known = isinstance(error, (InputError, UserError))
            reason = str(error) if known else f"{name}: cannot be worked through ({type(error).__name__}: {error})"
            if not known:
                _log.exception("%s", name)
            done = self.refusal(name, sha256, reason)
        done.message["seconds"] = round(time.monotonic() - begun, 3)
        return done

    def refusal(self, name: str, sha256: str, reason: str) -> Done:
        """Of a log that nothing can be done with."""
        about = {"log": name, "sha256": sha256, "model": self.name, "status": "refused", "reason": printable(reason)}
        return Done(sha256, name, self.name, "refused", about)

    def _predicted(self, path: Path, name: str, sha256: str, about: dict[str, Any]) -> Done:
        log = read_log(path, self._robot)
        _require_a_day(log)
        if log.q.shape[1] != self.model.axes:
            raise InputError(path, f"has {log.q.shape[1]} axes, the model {self.model.axes}")
        stream = self._power(log)
        lag_s, how = self._lag(log, stream)
        recording = merge(path.stem, log, stream, lag_s, 0.0, self.model.step_s)
        segments = self._segments(path, recording, log)
        about["covered"] = round(self._covered(segments, log), 4)
        predicted = predictions(self.model, segments)
        errors = residuals(predicted, segments)
        for segment in segments:
            outside = self._envelope.outside(segment.q, self.model.step_s)
            about["outside_envelope"] = max(float(outside.mean()), about.get("outside_envelope", 0.0))
        alarm = None
        if self.monitor is not None and how == _SURE_LAG:  # a lag off by 10 ms is a change of the residual, too
            for segment, off, guess in zip(segments, errors, predicted, strict=True):
                alarm = self.monitor.update(off, guess, segment.start_s, self.model.step_s) or alarm
        P, guess = np.concatenate([s.P for s in segments]), np.concatenate(predicted)
        hours = self.model.step_s / 3600
        about |= {
            "status": "ok", "measured": stream.measured, "rows": len(P), "lag_s": round(lag_s, 5), "lag_by": how,
            "begin": rfc3339(segments[0].start_s),
            "end": rfc3339(segments[-1].start_s + len(segments[-1].P) * self.model.step_s),
            "rmse_W": rms(errors), "mae_W": float(np.abs(np.concatenate(errors)).mean()),
            "energy_kWh": float(P.sum()) * hours / 1000, "energy_predicted_kWh": float(guess.sum()) * hours / 1000,
            "drift": self._drift(), "alarm": None if alarm is None else alarm.as_json() | {"log": name},
        }  # fmt: skip
        stamps = [s.start_s + self.model.step_s * np.arange(len(s.P)) for s in segments]
        times = np.array([filetime(round(t * 1e9)) for t in np.concatenate(stamps).tolist()])
        return Done(sha256, name, self.name, "ok", about, times, P, guess)

    def _drift(self) -> str:
        if self.monitor is None:
            return "not watched"
        return "alarm" if self.monitor.alarm is not None else "none"

    def _power(self, log: RobotLog) -> PowerStream:
        """The rows of the log's span, waited for if the last ones are still on their way. Raises NoPowerYetError."""
        stamps, _ = in_time(log)
        offset = self._lags[-1][1] if self._lags else 0.0
        patience = time.monotonic() + self.settings.patience_s
        while (newest := self._newest()) is None or newest < stamps[-1] - offset - _MARGIN_S:
            if time.monotonic() > patience:
                shown = "none" if newest is None else rfc3339(newest)
                raise NoPowerYetError(
                    f"{log.path.name}: no power rows up to {rfc3339(stamps[-1])} yet, the newest is of {shown}"
                )
            time.sleep(_PAUSE_S)
        while time.monotonic() < patience and newest is not None and newest < stamps[-1] - offset:
            time.sleep(_PAUSE_S)  # the last moments are still on their way
            newest = self._newest()
        far = self.settings.clocks_apart_s + _MARGIN_S
        span = (round((stamps[0] - far) * 1e9), round((stamps[-1] + far) * 1e9))
        try:
            return open_power(self.settings.database, self.settings.device, self.settings.channel, span, self._engine)
        except UserError as error:
            told = f"{rfc3339(stamps[0])} to {rfc3339(stamps[-1])}"
            raise UserError(f"{log.path.name}: power rows are missing for {told} ({error})") from None

    def _newest(self) -> float | None:
        """UTC of the newest row's begin; of whatever device, when none was named."""
        own = [] if self.settings.device is None else [power.c.device == self.settings.device]
        with self._engine.connect() as connection:
            newest = connection.execute(sa.select(sa.func.max(power.c.filetime)).where(*own)).scalar()
        return None if newest is None else unix_s(newest)

    def _lag(self, log: RobotLog, stream: PowerStream) -> tuple[float, str]:
        """Controller minus power clock at the log's middle, and by what it was told. Raises UserError."""
        explanation = explain(log, self._robot)
        known_s = [1.5 * abs(self._lags[-1][1]) + SEARCH_S] if self._lags else []  # searched further if that finds none
        search_s = min([*known_s, self.settings.clocks_apart_s])
        located = locate([explanation], stream, search_s, lambda _: None).located[0]
        own = located.own
        if own.credible:
            own = replace(own, seconds=own.seconds - self._later(log, stream, own.seconds))
        placed = self.placed(float(explanation.t[len(explanation.t) // 2]), own)
        if placed is None:
            reason = located.note or "no lag explains the power"
            raise UserError(f"{log.path.name}: {reason}{self._gaps(log, stream)}")
        return placed

    def _gaps(self, log: RobotLog, stream: PowerStream) -> str:
        """A likely reason why a log cannot be placed."""
        stamps, _ = in_time(log)
        offset = self._lags[-1][1] if self._lags else 0.0
        t = stream.time_ns[np.isfinite(stream.P)] * 1e-9 + offset
        there = np.count_nonzero((t >= stamps[0]) & (t <= stamps[-1])) * stream.window_ns * 1e-9
        missing = 1 - there / max(stamps[-1] - stamps[0], 1e-9)
        return f"; power rows are missing for {missing:.0%} of the log" if missing > _NOTEWORTHY_GAP else ""

    def placed(self, middle_s: float, own: Lag) -> tuple[float, str] | None:
        """By the line of the last logs, or by what a log alone says; None when that is nothing credible."""
        before = [Lag(*each[1:]) for each in self._lags]
        times = np.array([*(each[0] for each in self._lags), middle_s])
        if own.credible:
            self._lags = [*self._lags, (middle_s, own.seconds, own.r2, own.ratio)][-_REMEMBERED:]
        line = fit_line(times, [*before, own])
        if line is not None and own.credible and deviates(line, middle_s, own):
            self._lags = self._lags[-1:]  # the clock was set: a new line begins with this log
            return own.seconds, "own"
        if line is not None:
            return float(line.at(middle_s)), _SURE_LAG
        if own.credible:
            return own.seconds, "own"
        return (float(np.median([lag.seconds for lag in before])), "earlier logs") if before else None

    def _later(self, log: RobotLog, stream: PowerStream, lag_s: float) -> float:
        """s that power is later than the model has it: the model knows this robot better than any regression."""
        recording = merge(log.path.stem, log, stream, lag_s, 0.0, self.model.step_s)
        segments = self._segments(log.path, recording, log)
        found = [
            delay_of(guess, segment.P, self.model.step_s)
            for guess, segment in zip(predictions(self.model, segments), segments, strict=True)
        ]
        told = [delay for delay, gain, _ in found if gain > 0.0 and abs(delay) < _MOST_LATER_S]
        return float(np.median(told)) if told else 0.0

    def _segments(self, path: Path, recording: Recording, log: RobotLog) -> list[Segment]:
        entry: dict[str, object] = {"name": path.stem, "source": path.stem, "kind": "other", "split": "test"}
        columns = {"time_ns": recording.time_ns, "valid": recording.valid, **recording.columns}
        found = segments_of(columns, entry, self.model.step_s)  # type: ignore[arg-type]
        covered = self._covered(found, log)
        if covered < _LEAST_COVERED:
            raise UserError(
                f"{path.name}: power rows are missing for {1 - covered:.0%} of the log; was the meter or the sink off?"
            )
        return found

    def _covered(self, segments: list[Segment], log: RobotLog) -> float:
        """Share of the log's time that is compared."""
        stamps, _ = in_time(log)
        seconds = sum(len(each.P) for each in segments) * self.model.step_s
        return min(1.0, float(seconds / max(stamps[-1] - stamps[0], 1e-9)))


def device_of(engine: sa.Engine, wanted: str | None, usual: str) -> str:
    """Whose power rows: the one that was asked for, or the only one there is; `usual` before there is any.

    Raises UserError when there are several.
    """
    if wanted is not None:
        return wanted
    found: list[str] = []
    with engine.connect() as connection:  # from name to name along the key: DISTINCT would read a year of rows
        query = sa.select(sa.func.min(power.c.device))
        while name := connection.execute(query.where(power.c.device > found[-1]) if found else query).scalar():
            found.append(name)
    if len(found) > 1 and usual not in found:
        raise UserError(f"the database holds rows of several devices; choose one with --device: {', '.join(found)}")
    return found[0] if len(found) == 1 else usual


def rfc3339(t: float) -> str:
    """UTC of Unix seconds."""
    return datetime.fromtimestamp(t, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def printable(text: str) -> str:
    """One line that UTF-8 can hold, unlike texts unlike: names of files may be any bytes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def _require_a_day(log: RobotLog) -> None:
    """Raises InputError for times that are none, or a log longer than a day."""
    stamps, _ = in_time(log)
    if not (stamps[0] >= 0 and stamps[-1] < _LATEST_S):
        raise InputError(log.path, f"times from {stamps[0]:.4g} to {stamps[-1]:.4g} s are no Unix time")
    if stamps[-1] - stamps[0] > _LONGEST_S:
        raise InputError(log.path, f"is {(stamps[-1] - stamps[0]) / 3600:.1f} h long; a log of at most 6 h is expected")


def hash_of(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
