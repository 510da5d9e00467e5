"""One robot log: placed in the metered power, predicted, compared."""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from acqd.dataset.align import Lag
from acqd.dataset.clock import filetime
from acqd.dataset.clocks import fit_line
from acqd.dataset.explain import explain
from acqd.dataset.locate import locate
from acqd.dataset.merge import Recording, merge
from acqd.dataset.power import PowerStream, open_power
from acqd.discrepancy.augment import errors_of, rms
from acqd.discrepancy.delay import delay_of
from acqd.discrepancy.sequential import Monitor
from acqd.discrepancy.watching import baseline_of
from acqd.errors import InputError, UserError
from acqd.models.data import Stretch, stretches_of
from acqd.models.envelope import Envelope
from acqd.models.metrics import predictions
from acqd.models.restore import open_model
from acqd.robot.description import load_description
from acqd.robot.log import RobotLog, in_time, read_log
from acqd.sidecar.store import Done

_SEARCH_S = 2.4
_MARGIN_S = 5.0
_REMEMBERED = 30  # logs whose lags make the clock's line
_LEAST_COVERED = 0.5
_PAUSE_S = 0.2
_SURE_LAG = "clock line"
_MOST_LATER_S = 0.1


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

    def __init__(self, settings: Settings) -> None:
        """Raises UserError, InputError."""
        self.settings = settings
        self.bundle, self.model = open_model(settings.bundle)
        self._robot = load_description(self.bundle.about["description"])
        self._envelope = Envelope.from_json(self.bundle.about["envelope"])
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
        return str(self.bundle.about["name"])

    def restore(self, memory: Any) -> None:
        """Where an earlier sidecar with the same model stopped."""
        if memory and memory.get("model") == self._identity():
            self._lags = [tuple(each) for each in memory["lags"]]
            if self.monitor is not None and memory["monitor"]:
                self.monitor.restore(memory["monitor"])

    def memory(self) -> dict[str, Any]:
        """For `restore`."""
        monitor = None if self.monitor is None else self.monitor.as_json()
        return {"model": self._identity(), "lags": [list(each) for each in self._lags], "monitor": monitor}

    def _identity(self) -> str:
        return f"{self.name} {self.bundle.about['provenance'].get('manifest_sha256', '')}"

    def run(self, path: Path, sha256: str) -> Done:
        """Work through one file; what is wrong with it is told in the result, never raised."""
        begun = time.monotonic()
        about: dict[str, Any] = {"log": path.name, "sha256": sha256, "model": self.name}
        try:
            done = self._predicted(path, sha256, about)
        except (InputError, UserError) as error:
            about |= {"status": "refused", "reason": str(error)}
            done = Done(sha256, path.name, self.name, "refused", about)
        done.message["seconds"] = round(time.monotonic() - begun, 3)
        return done

    def _predicted(self, path: Path, sha256: str, about: dict[str, Any]) -> Done:
        log = read_log(path, self._robot)
        if log.q.shape[1] != self.model.axes:
            raise InputError(path, f"has {log.q.shape[1]} axes, the model {self.model.axes}")
        power = self._power(log)
        lag_s, how = self._lag(log, power)
        recording = merge(path.stem, log, power, lag_s, 0.0, self.model.step_s)
        stretches = self._stretches(path, recording, log)
        predicted, errors = predictions(self.model, stretches), errors_of(self.model, stretches)
        for stretch in stretches:
            outside = self._envelope.outside(stretch.q, self.model.step_s)
            about["outside_envelope"] = max(float(outside.mean()), about.get("outside_envelope", 0.0))
        alarm = None
        if self.monitor is not None and how == _SURE_LAG:  # a lag off by 10 ms is a change of the residual, too
            for stretch, off, guess in zip(stretches, errors, predicted, strict=True):
                alarm = self.monitor.update(off, guess, stretch.start_s, self.model.step_s) or alarm
        P, guess = np.concatenate([s.P for s in stretches]), np.concatenate(predicted)
        hours = self.model.step_s / 3600
        about |= {
            "status": "ok", "measured": power.measured, "rows": len(P), "lag_s": round(lag_s, 5), "lag_by": how,
            "begin": _rfc3339(stretches[0].start_s),
            "end": _rfc3339(stretches[-1].start_s + len(stretches[-1].P) * self.model.step_s),
            "rmse_W": rms(errors), "mae_W": float(np.abs(np.concatenate(errors)).mean()),
            "energy_kWh": float(P.sum()) * hours / 1000, "energy_predicted_kWh": float(guess.sum()) * hours / 1000,
            "drift": self._drift(), "alarm": None if alarm is None else alarm.as_json() | {"log": path.name},
        }  # fmt: skip
        stamps = [s.start_s + self.model.step_s * np.arange(len(s.P)) for s in stretches]
        times = np.array([filetime(round(t * 1e9)) for t in np.concatenate(stamps).tolist()])
        return Done(sha256, path.name, self.name, "ok", about, times, P, guess)

    def _drift(self) -> str:
        if self.monitor is None:
            return "not watched"
        return "alarm" if self.monitor.alarm is not None else "none"

    def _power(self, log: RobotLog) -> PowerStream:
        """The rows of the log's span, waited for if the last ones are still on their way."""
        stamps, _ = in_time(log)
        far = self.settings.clocks_apart_s + _MARGIN_S
        span = (round((stamps[0] - far) * 1e9), round((stamps[-1] + far) * 1e9))
        patience = time.monotonic() + self.settings.patience_s
        while True:
            try:
                power = open_power(self.settings.database, self.settings.device, self.settings.channel, span)
            except UserError as error:
                power, reason = None, str(error)
            offset = self._lags[-1][1] if self._lags else 0.0
            if power is not None:
                last = (int(power.time_ns[-1]) + power.window_ns) * 1e-9
                if last >= stamps[-1] - offset:
                    return power
            if time.monotonic() > patience:
                break
            time.sleep(_PAUSE_S)
        if power is None:
            raise UserError(
                f"{log.path.name}: no power rows for {_rfc3339(stamps[0])} to {_rfc3339(stamps[-1])} ({reason})"
            )
        return power  # merging tells how much is missing

    def _lag(self, log: RobotLog, power: PowerStream) -> tuple[float, str]:
        """Controller minus power clock: by the line of the last logs, or by this one alone."""
        explanation = explain(log, self._robot)
        located = locate([explanation], power, self.settings.clocks_apart_s, lambda _: None).located[0]
        middle = float(explanation.t[len(explanation.t) // 2])
        before = [Lag(*each[1:]) for each in self._lags]
        own = located.own
        if own.credible:
            own = replace(own, seconds=own.seconds - self._later(log, power, own.seconds))
            self._lags = [*self._lags, (middle, own.seconds, own.r2, own.ratio)][-_REMEMBERED:]
        lags = [*before, own]
        times = np.array([*(each[0] for each in self._lags[: len(before)]), middle])
        line = fit_line(times, lags) if len(times) == len(lags) else None
        if line is not None:
            return float(line.at(middle)), _SURE_LAG
        if own.credible:
            return own.seconds, "own"
        if before:
            return float(np.median([lag.seconds for lag in before])), "earlier logs"
        raise UserError(f"{log.path.name}: {located.note or 'no lag explains the power'}")

    def _later(self, log: RobotLog, power: PowerStream, lag_s: float) -> float:
        """s that power is later than the model has it: the model knows this robot better than any regression."""
        recording = merge(log.path.stem, log, power, lag_s, 0.0, self.model.step_s)
        stretches = self._stretches(log.path, recording, log)
        found = [
            delay_of(guess, stretch.P, self.model.step_s)
            for guess, stretch in zip(predictions(self.model, stretches), stretches, strict=True)
        ]
        told = [delay for delay, gain, _ in found if gain > 0.0 and abs(delay) < _MOST_LATER_S]
        return float(np.median(told)) if told else 0.0

    def _stretches(self, path: Path, recording: Recording, log: RobotLog) -> list[Stretch]:
        entry: dict[str, object] = {"name": path.stem, "source": path.stem, "kind": "other", "split": "test"}
        columns = {"time_ns": recording.time_ns, "valid": recording.valid, **recording.columns}
        found = stretches_of(columns, entry, self.model.step_s)  # type: ignore[arg-type]
        stamps, _ = in_time(log)
        covered = sum(len(each.P) for each in found) * self.model.step_s / max(stamps[-1] - stamps[0], 1e-9)
        if covered < _LEAST_COVERED:
            raise UserError(
                f"{path.name}: power rows are missing for {1 - covered:.0%} of the log; was the meter or the sink off?"
            )
        return found


def _rfc3339(t: float) -> str:
    return datetime.fromtimestamp(t, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def hash_of(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
