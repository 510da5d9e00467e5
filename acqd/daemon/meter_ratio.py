"""`acqd doctor --wiring` for an RMS meter, which has no phasors: its readings, and its ratio by the load's power."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from acqd.daemon.config import Config
from acqd.daemon.heard import Heard
from acqd.errors import OperationError, UserError
from acqd.metering.current_ratio import beyond_rated, wrong_ratio

_PHASES = ("L1", "L2", "L3")
_READ = ("Vrms", "Irms", "P", "PF")
_UNKNOWN = (
    "the ratio of the current transformers scales I, P and S alike, so no reading shows it: give the load's power "
    "(--power W), the most that it takes (--rated W), or compare with the nameplates"
)


def examine_meter(
    config: Config, device: str, seconds: float, expected_W: float | None, rated_W: float | None
) -> dict[str, Any]:
    """Mean readings of `seconds`, by phase, and what they say of the ratio.

    `expected_W`, `rated_W`: as in `examine_wiring`. Raises UserError where nothing can be heard of the meter.
    """
    if not device and len(config.devices) > 1:
        raise UserError(f"there are several meters: choose one with --device ({', '.join(config.devices)})")
    device = device or config.devices[0]
    if device not in config.devices:
        raise UserError(f"there is no meter {device!r}; the configuration has {', '.join(config.devices)}")
    if not config.mqtt.enabled:
        raise UserError(f"{device} is an RMS meter, whose rows are heard by MQTT: set [mqtt] enabled = true")
    address = config.mqtt.address()
    rows = Heard(address, device, [f"{phase}/power" for phase in _PHASES], _READ)
    predictions = Heard(address, device, ["prediction/live"], ["P_predicted"])
    time.sleep(seconds)
    rows.stop()
    predictions.stop()
    if expected_W is None:
        expected_W = predictions.mean("prediction/live", "P_predicted")
    return judged(rows, device, expected_W, rated_W)


def judged(rows: Heard, device: str, expected_W: float | None, rated_W: float | None) -> dict[str, Any]:
    """Readings and findings of what has been heard. Raises OperationError without rows."""
    means = {phase: {name: rows.mean(f"{phase}/power", name) for name in _READ} for phase in _PHASES}
    readings = {phase: found for phase, found in means.items() if found["P"] is not None and found["Irms"] is not None}
    if not readings:
        raise OperationError(rows.trouble or f"no power rows of {device} on the broker; does acqd run with this meter?")
    P, currents = (np.array([found[name] for found in readings.values()], dtype=float) for name in ("P", "Irms"))
    wrong = beyond_rated(P, rated_W) if rated_W is not None else None
    if expected_W is not None:
        wrong = wrong_ratio(P, currents, expected_W) or wrong
    findings = [] if wrong is None else [{"text": wrong.text, "correction": "set the ratio in the meter"}]
    note = _UNKNOWN if expected_W is None and rated_W is None else ""
    return {"findings": findings, "phasors": {}, "readings": readings, "note": note}
