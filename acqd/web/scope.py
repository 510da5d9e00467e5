"""One window of v(t) and i(t) with harmonics up to the 40th, of the samples that the daemon's /window has."""

from __future__ import annotations

import json
import threading
import time
from http.client import HTTPConnection, HTTPException
from typing import Any
from urllib.parse import quote

import numpy as np
import orjson

from acqd.arrays import Floats
from acqd.daemon.health.section import HealthSection
from acqd.metering.frequency import FrequencyEstimator

HARMONICS = 40
_POINTS = 500
_USABLE_SHARE = 0.45
"""Of the sampling rate: components above are beyond the anti-aliasing filter of any converter."""
_TIMEOUT_S = 2.0
_KEPT_S = 0.4
_LARGEST = 1 << 24


class ScopeError(Exception):
    """Why there is no picture, in one line for the page."""


class Scope:
    """Fetches and analyses a window when a viewer asks; viewers who ask within 0.4 s get the same one."""

    def __init__(self, section: HealthSection) -> None:
        self._section = section
        self._kept: dict[str, tuple[float, bytes]] = {}
        self._lock = threading.Lock()

    def picture(self, device: str) -> bytes:
        """JSON of `analysed`. Raises ScopeError. Waits for the daemon: call it in a thread."""
        with self._lock:
            at, body = self._kept.get(device, (0.0, b""))
            if time.monotonic() - at > _KEPT_S:
                body = orjson.dumps(analysed(_window(self._section, device)), option=orjson.OPT_SERIALIZE_NUMPY)
                self._kept = {device: (time.monotonic(), body)}
            return body


def _window(section: HealthSection, device: str) -> dict[str, Any]:
    if not section.port:
        raise ScopeError("no samples: [health] port is 0, and the daemon shows its samples there")
    connection = HTTPConnection(section.host, section.port, timeout=_TIMEOUT_S)
    try:
        connection.request("GET", f"/window?device={quote(device)}")
        answer = connection.getresponse()
        body: dict[str, Any] = json.loads(answer.read(_LARGEST))
        if answer.status != 200:
            raise ScopeError(f"no samples: {body['error']}")
        return body
    except OSError as error:
        raise ScopeError(f"no answer at http://{section.host}:{section.port}/window ({error})") from None
    except (HTTPException, ValueError, KeyError, TypeError):
        raise ScopeError(f"what answers at {section.host}:{section.port} is no daemon of acqd") from None
    finally:
        connection.close()


def analysed(window: dict[str, Any]) -> dict[str, Any]:
    """Thinned traces [V or A], frequency [Hz], and per channel RMS, fundamental, THD and harmonics in % of it.

    Harmonics are a least-squares fit of all orders at once to the window, which need not be a whole number of cycles;
    a fundamental that is not credible gives no harmonics.
    """
    scale = np.asarray(window["scale"], dtype=float)
    samples = np.asarray(window["codes"], dtype=float) * scale[:, None]
    rate, count = float(window["rate"]), samples.shape[1]
    estimate = FrequencyEstimator(rate, count).estimate(samples[0::2], np.array([count]))
    f = float(estimate[0]) if np.isfinite(estimate[0]) else None
    stride = -(-count // _POINTS)
    names = list(window["channels"])
    amplitudes = harmonics(samples, rate, f) if f is not None else None
    return {
        **{key: window[key] for key in ("device", "seq", "time", "filetime", "flags")},
        "f": f,
        "ms": np.round(np.arange(0, count, stride) * 1e3 / rate, 4).tolist(),
        "traces": {name: _rounded(samples[k, ::stride]) for k, name in enumerate(names)},
        "figures": {
            name: _figures(samples[k], None if amplitudes is None else amplitudes[k]) for k, name in enumerate(names)
        },
    }


def harmonics(samples: Floats, rate: float, f: float) -> Floats:
    """RMS of orders 1, 2 ... (at most 40) [channels, orders] of a window `samples` [channels, T]."""
    orders = np.arange(1, min(HARMONICS, int(_USABLE_SHARE * rate / f)) + 1)
    phase = 2 * np.pi * f / rate * np.outer(np.arange(samples.shape[1]), orders)
    columns = np.column_stack([np.ones(samples.shape[1]), np.cos(phase), np.sin(phase)])
    solution = np.linalg.lstsq(columns, samples.T, rcond=None)[0]
    cosines, sines = solution[1 : len(orders) + 1], solution[len(orders) + 1 :]
    amplitudes: Floats = np.hypot(cosines, sines).T / np.sqrt(2)
    return amplitudes


def _figures(x: Floats, amplitudes: Floats | None) -> dict[str, Any]:
    figures: dict[str, Any] = {"rms": float(np.sqrt((x * x).mean())), "peak": float(np.abs(x).max())}
    if amplitudes is None or amplitudes[0] <= 0:
        return figures | {"fundamental": None, "thd": None, "percent": []}
    percent = 100 * amplitudes[1:] / amplitudes[0]
    thd = float(np.sqrt((percent * percent).sum()))
    return figures | {"fundamental": float(amplitudes[0]), "thd": thd, "percent": _rounded(percent)}


def _rounded(values: Floats) -> list[float]:
    return [float(f"{value:.4g}") for value in values.tolist()]
