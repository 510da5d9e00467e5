"""What the sidecar keeps and publishes of one log: its message and its rows."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
import orjson

from acqd.arrays import Floats
from acqd.models.bundle.envelope import Envelope
from acqd.report.digits import percent
from acqd.sidecar.clock_memory import PlacedLag
from acqd.sidecar.comparison import Comparison
from acqd.sidecar.log_file import printable
from acqd.sidecar.residual import rms
from acqd.sidecar.store import Done
from acqd.timestamps import filetime, rfc3339_ms

_log = logging.getLogger(__name__)
_NOTEWORTHY = 0.02  # of a log's time


@dataclass(frozen=True, slots=True)
class Identity:
    """Names of a log and of the model that predicts it."""

    log: str
    sha256: str
    model: str

    def refusal(self, reason: str) -> Done:
        """The result of a log that cannot be compared."""
        message = self._message() | {"status": "refused", "reason": printable(reason)}
        return Done(self.sha256, self.log, self.model, "refused", message)

    def result(
        self, comparison: Comparison, lag: PlacedLag, measured: str, envelope: Envelope, drift: dict[str, Any]
    ) -> Done:
        """The result of a comparison; `drift` holds the keys drift and alarm of the message."""
        message = self._message()
        message["covered"] = round(comparison.covered, 4)
        message["outside_envelope"] = _outside(comparison, envelope)
        message |= {"status": "ok", "measured": measured} | _figures(comparison, lag) | drift
        P, predicted = np.concatenate([s.P for s in comparison.segments]), np.concatenate(comparison.predicted)
        return Done(self.sha256, self.log, self.model, "ok", message, _filetimes(comparison), P, predicted)

    def _message(self) -> dict[str, Any]:
        return {"log": self.log, "sha256": self.sha256, "model": self.model}


def log_result(done: Done) -> None:
    """Writes a result to the program's log, one line, and one for an alarm."""
    if done.status == "refused":
        _log.warning("%s", done.message["reason"])
    else:
        missing = 1 - done.message["covered"]
        note = f"; {percent(missing)} of it could not be compared" if missing > _NOTEWORTHY else ""
        _log.info("%s: residual %.2f W RMS%s", done.name, done.message["rmse_W"], note)
    if done.message.get("alarm"):
        _log.warning("the residual has changed: %s", orjson.dumps(done.message["alarm"]).decode())


def _figures(comparison: Comparison, lag: PlacedLag) -> dict[str, Any]:
    segments, step_s = comparison.segments, comparison.step_s
    hours = step_s / 3600
    return {
        "rows": sum(len(segment.P) for segment in segments),
        "lag_s": round(lag.seconds, 5),
        "lag_by": lag.by,
        "begin": rfc3339_ms(segments[0].start_s),
        "end": rfc3339_ms(segments[-1].start_s + len(segments[-1].P) * step_s),
        "rmse_W": rms(comparison.errors),
        "mae_W": float(np.abs(np.concatenate(comparison.errors)).mean()),
        "energy_kWh": _kilowatt_hours([segment.P for segment in segments], hours),
        "energy_predicted_kWh": _kilowatt_hours(comparison.predicted, hours),
    }


def _kilowatt_hours(power: list[Floats], hours: float) -> float:
    return float(np.concatenate(power).sum()) * hours / 1000


def _outside(comparison: Comparison, envelope: Envelope) -> float:
    """The largest share of a segment's rows outside the training envelope."""
    return max(float(envelope.outside(s.q, comparison.step_s).mean()) for s in comparison.segments)


def _filetimes(comparison: Comparison) -> np.ndarray[Any, np.dtype[np.int64]]:
    times = [s.start_s + comparison.step_s * np.arange(len(s.P)) for s in comparison.segments]
    return np.array([filetime(round(t * 1e9)) for t in np.concatenate(times).tolist()])
