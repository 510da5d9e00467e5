"""`acqd doctor --wiring`: the wiring of a running daemon's device, from a minute of its samples."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from acqd.daemon.config import Config
from acqd.daemon.correction_section import CorrectionSection
from acqd.daemon.device_section import WaveformKeys
from acqd.daemon.health.capture import captured
from acqd.daemon.heard import Heard
from acqd.daemon.meter_ratio import examine_meter
from acqd.errors import UserError
from acqd.metering.meter import INTERRUPTION
from acqd.metering.phasors import Phasors, phasors
from acqd.metering.wiring_check import examine
from acqd.metering.wiring_watch import Wired
from acqd.sources.load import load_waveform

_PIECE_S = 1.0
_LIVE = "prediction/live"


def examine_wiring(
    config: Config, device: str, seconds: float, expected_W: float | None, rated_W: float | None = None
) -> dict[str, Any]:
    """Phasors of `seconds` and what they say, as in the status; of an RMS meter its readings.

    `expected_W`: power of the load in this time; None: the mean of what a sidecar predicts meanwhile, if one does.
    `rated_W`: the most that the load takes for long.
    Raises UserError for a stream without mains, OperationError without a daemon.
    """
    name = device or config.device
    if not config.sampled or device in set(config.devices) - set(config.sampled):
        return examine_meter(config, device, seconds, expected_W, rated_W)
    predictions = Heard(config.mqtt.address() if config.mqtt.enabled else None, name, [_LIVE], ["P_predicted"])
    total: list[np.ndarray] = []
    end = time.monotonic() + seconds
    try:
        while not total or time.monotonic() < end:
            found = _look(config, device)
            total.append(np.stack((found.U, found.I)))
            time.sleep(max(0.0, min(_PIECE_S, end - time.monotonic())))
    finally:
        predictions.stop()
    predicted = predictions.mean(_LIVE, "P_predicted")
    mean = Phasors(*np.mean(total, axis=0))
    if np.abs(mean.U).max() < INTERRUPTION * config.metering.nominal_voltage:
        raise UserError(f"{name}: no mains ({np.abs(mean.U).max():.3g} V); switch it on, and the load too")
    wired = Wired(mean, tuple(examine(mean, predicted if expected_W is None else expected_W, rated_W)))
    return wired.as_dict(_correction(config, name).after)


def _correction(config: Config, device: str) -> CorrectionSection:
    """Of the source with this device; the samples are those after it."""
    found = next((box.source for box in config.sources if device in box.devices), config.source)
    if isinstance(found, WaveformKeys):
        return found.correction
    return CorrectionSection()


def _look(config: Config, device: str) -> Phasors:
    with tempfile.NamedTemporaryFile(suffix=".npz") as file:
        file.write(captured(config.health, device, _PIECE_S))
        file.flush()
        waveform = load_waveform(Path(file.name))
    form = waveform.form
    return phasors(waveform.codes * np.array(form.scale), form.rate, form.f_nominal)
