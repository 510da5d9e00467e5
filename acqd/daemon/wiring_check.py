"""`acqd doctor --wiring`: the wiring of a running daemon's device, from a minute of its samples."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from acqd.daemon.config import Config
from acqd.daemon.correction_section import CorrectionSection
from acqd.daemon.device_section import WaveformKeys
from acqd.daemon.health.capture import captured
from acqd.errors import UserError
from acqd.metering.meter import INTERRUPTION
from acqd.metering.phasors import Phasors, phasors
from acqd.metering.wiring_check import examine
from acqd.metering.wiring_watch import Wired
from acqd.sources.load import load_waveform
from acqd.telemetry.mqtt import BrokerAddress

_PIECE_S = 1.0
_MOST_PREDICTIONS = 100_000


def examine_wiring(
    config: Config, device: str, seconds: float, expected_W: float | None, rated_W: float | None = None
) -> dict[str, Any]:
    """Phasors of `seconds` and what they say, as in the status.

    `expected_W`: power of the load in this time; None: the mean of what a sidecar predicts meanwhile, if one does.
    `rated_W`: the most that the load takes for long.
    Raises UserError for a stream without mains, OperationError without a daemon.
    """
    name = device or config.device
    predictions = _Predictions(config.mqtt.address() if config.mqtt.enabled else None, name)
    total: list[np.ndarray] = []
    end = time.monotonic() + seconds
    try:
        while not total or time.monotonic() < end:
            found = _look(config, device)
            total.append(np.stack((found.U, found.I)))
            time.sleep(max(0.0, min(_PIECE_S, end - time.monotonic())))
    finally:
        predicted = predictions.mean_W()
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


class _Predictions:
    """Power that a sidecar predicts for a device while this object lives."""

    def __init__(self, address: BrokerAddress | None, device: str) -> None:
        self._powers: list[float] = []
        self._client: mqtt.Client | None = None
        if address is None:
            return
        client = mqtt.Client(CallbackAPIVersion.VERSION2)
        if address.username:
            client.username_pw_set(address.username, address.password)
        if (context := address.tls_context()) is not None:
            client.tls_set_context(context)
        self._topic = f"acqd/{device}/prediction/live"
        client.on_connect = self._subscribe
        client.on_message = lambda _client, _data, message: self._take(message.payload)
        client.connect_async(address.host, address.port)
        client.loop_start()
        self._client = client

    def _subscribe(self, client: mqtt.Client, *_: object) -> None:
        client.subscribe(self._topic)

    def _take(self, payload: bytes | bytearray) -> None:
        try:
            power = float(orjson.loads(payload)["P_predicted"])
        except (orjson.JSONDecodeError, KeyError, TypeError, ValueError):
            return
        if np.isfinite(power) and len(self._powers) < _MOST_PREDICTIONS:
            self._powers.append(power)

    def mean_W(self) -> float | None:  # noqa: N802 - the unit
        """Ends the connection; None without predictions."""
        if self._client is not None:
            self._client.disconnect()
            self._client.loop_stop()
        return float(np.mean(self._powers)) if self._powers else None
