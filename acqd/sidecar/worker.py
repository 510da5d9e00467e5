"""Works through one robot log after the other: places it in the metered power, predicts it, compares."""

from __future__ import annotations

import logging
import time
from pathlib import Path
from typing import Any, BinaryIO

import sqlalchemy as sa

from acqd.errors import InputError, UserError
from acqd.models.bundle.bundle import fingerprint
from acqd.models.bundle.envelope import Envelope
from acqd.models.bundle.restore import open_model
from acqd.robot.description import load_description
from acqd.sidecar.clock_memory import CLOCK_LINE, ClockMemory
from acqd.sidecar.log_file import open_log
from acqd.sidecar.placement import Placer
from acqd.sidecar.power_rows import PowerRows, PowerRowsMissingError
from acqd.sidecar.residual import DriftMonitor
from acqd.sidecar.result import Identity
from acqd.sidecar.settings import Settings
from acqd.sidecar.store import Done

_log = logging.getLogger(__name__)


class Worker:
    """One model and its memory of clock and drift; the memory is stored by the caller."""

    def __init__(self, settings: Settings, engine: sa.Engine) -> None:
        """Raises UserError, InputError."""
        self.settings = settings
        self.bundle, self.model = open_model(settings.bundle)
        self.clock = ClockMemory()
        self.drift = DriftMonitor(settings.bundle, self.model, settings.between_s)
        self.notes = [] if self.drift.note is None else [self.drift.note]
        self._power_rows = PowerRows(settings, engine)
        self._robot = load_description(self.bundle.metadata["description"])
        self._placer = Placer(self._robot, self.model, self.clock, settings.clocks_apart_s)
        self._envelope = Envelope.from_json(self.bundle.metadata["envelope"])

    @property
    def name(self) -> str:
        """Name of the model."""
        return str(self.bundle.metadata["name"])

    def memory(self) -> dict[str, Any]:
        """State for `restore`."""
        identity = fingerprint(self.settings.bundle)
        return {"model": identity, "lags": self.clock.as_json(), "monitor": self.drift.as_json()}

    def restore(self, memory: Any) -> None:
        """Continues from the state of `memory` if it is of the same model."""
        if not memory or memory.get("model") != fingerprint(self.settings.bundle):
            return
        try:
            self.clock.restore(memory["lags"])
            self.drift.restore(memory["monitor"])
        except (KeyError, ValueError, TypeError):
            _log.warning("the memory of an earlier version cannot be read: clock line and drift start again")

    def run(self, path: Path, file: BinaryIO, name: str, sha256: str) -> Done:
        """Works through the open file of the log `path`; a problem of the file becomes a refusal.

        Raises PowerRowsMissingError when the power rows have not arrived yet, sqlalchemy.exc.DBAPIError when the
        database gives nothing out now: these are no problems of the file.
        """
        started = time.monotonic()
        identity = Identity(name, sha256, self.name)
        try:
            done = self._compared(path, file, identity)
        except PowerRowsMissingError:
            raise
        except (InputError, UserError) as error:
            done = identity.refusal(str(error))
        except Exception as error:  # an odd log must not stop the logs behind it
            if isinstance(error, sa.exc.DBAPIError) and not isinstance(error, sa.exc.DataError):
                raise
            # its text may quote the file, and is not published
            _log.exception("%s", name)
            done = identity.refusal(f"{name}: cannot be worked through ({type(error).__name__})")
        done.message["seconds"] = round(time.monotonic() - started, 3)
        return done

    def refusal(self, name: str, sha256: str, reason: str) -> Done:
        """The result of a log that is given up."""
        return Identity(name, sha256, self.name).refusal(reason)

    def _compared(self, path: Path, file: BinaryIO, identity: Identity) -> Done:
        log = open_log(path, file, self._robot, self.model.axes)
        if log.note:
            _log.warning("%s: %s", identity.log, log.note)
        power = self._power_rows.of_span(log, self.clock.last_lag_s)
        comparison, lag = self._placer.place(log, power)
        alarm = None
        if lag.by == CLOCK_LINE:  # with another lag the residual may change by the error of the lag
            alarm = self.drift.update(comparison.errors, comparison.predicted, comparison.segments)
        alarm = None if alarm is None else alarm | {"log": identity.log}
        drift = {"drift": self.drift.state, "alarm": alarm}
        return identity.result(comparison, lag, power.measured, self._envelope, drift)
