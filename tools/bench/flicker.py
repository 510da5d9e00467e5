"""Flicker of the test signals of IEC 61000-4-15 (simulated), ours and pqopen-lib's."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.conformance.flicker_tables import RECTANGULAR, SINUSOIDAL, rectangular, sinusoidal
from acqd.metering.quality.flicker import PinstStream
from acqd.metering.quality.severity import SHORT_S, short_term
from tools.bench.report import Figure

_RATE = 10_000.0  # of the signals; pqopen-lib works at 5 kHz inside
_SETTLED_S = 120.0


def pinst() -> Iterator[Figure]:
    """The largest Pinst of every sinusoidal test signal, which should be 1."""
    for (lamp, f), table in SINUSOIDAL.items():
        errors = []
        for hertz, percent in table.items():
            u = sinusoidal(lamp, f, hertz, percent, _RATE, 30.0)
            stream = PinstStream(1, _RATE, f, lamp)  # type: ignore[arg-type]
            Pinst = stream.feed(_whole(u, stream.step * stream.thin))[0]
            errors.append(abs(Pinst[len(Pinst) // 2 :].max() - 1))
        yield Figure(
            "flicker: simulated", f"Pinst, {lamp} {f} Hz, worst of {len(table)}", 100 * max(errors), "%", "<= 5"
        )


def pst() -> Iterator[Figure]:
    """Pst of every rectangular test signal of ten minutes, which should be 1."""
    for (lamp, f), table in RECTANGULAR.items():
        methods: list[tuple[str, Callable[[Floats], float], str]] = [
            ("acqd", lambda u, lamp=lamp, f=f: _ours(u, lamp, f), "<= 5")  # type: ignore[misc]
        ]
        if (lamp, f) == ("230V", 50):
            methods.append(("pqopen-lib", _pqopen, ""))
        signals = [rectangular(lamp, f, m, p, _RATE, SHORT_S + _SETTLED_S) for m, p in table.items() if m < 4000]
        for name, method, target in methods:
            begun = time.process_time()
            errors = [100 * abs(method(u) - 1) for u in signals]
            speed = len(signals) * (SHORT_S + _SETTLED_S) / (time.process_time() - begun)
            yield Figure("flicker: simulated", f"Pst, {lamp} {f} Hz, worst of 6: {name}", max(errors), "%", target)
            yield Figure("flicker: simulated", f"speed, {lamp} {f} Hz: {name}", speed, "x real time")


def _whole(u: Floats, chunk: int) -> Floats:
    return u[None, : len(u) // chunk * chunk]


def _ours(u: Floats, lamp: str, f: int) -> float:
    stream = PinstStream(1, _RATE, f, lamp)  # type: ignore[arg-type]
    chunk = stream.step * stream.thin
    pieces = [stream.feed(_whole(u[k : k + 100_000], chunk)) for k in range(0, len(u), 100_000)]
    return float(short_term(np.concatenate(pieces, axis=1)[:, -round(SHORT_S * _RATE / chunk) :])[0])


def _pqopen(u: Floats) -> float:
    from pqopen.powerquality import VoltageFluctuation

    half = round(_RATE / 100)
    meter = VoltageFluctuation(_RATE, 230, 50)
    second = round(_RATE)
    for k in range(0, len(u), second):
        raw = u[k : k + second]
        meter.process(k, np.sqrt((raw.reshape(-1, half) ** 2).mean(axis=1)), raw)
    return float(meter.calc_pst(len(u) - round(SHORT_S * _RATE), len(u)))
