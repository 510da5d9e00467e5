"""The 1 s summary: what a dashboard wants instead of 25 rows a second."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from typing import Any

from acqd.metering import WindowBatch
from acqd.telemetry.row import PowerRow, rfc3339


class Summariser:
    """Collects rows until the stream's UTC second changes, then gives one summary per channel."""

    def __init__(self) -> None:
        self._rows: dict[str, list[PowerRow]] = defaultdict(list)
        self._second: int | None = None
        self._registers: list[tuple[float, float]] = []  # each phase's (imported, exported) [kWh] at the last row

    def add(self, batch: WindowBatch, rows: Iterable[PowerRow]) -> list[dict[str, Any]]:
        """Take a batch and its rows; the summaries that they complete."""
        done: list[dict[str, Any]] = []
        window = {seq: k for k, seq in enumerate(batch.seq.tolist())}
        for row in rows:
            k = window[row.seq]
            second = int(batch.utc_ns[k]) // 1_000_000_000
            if self._second is not None and second != self._second:
                done += self._close()
            self._second = second
            self._rows[row.channel].append(row)
            self._registers = list(zip(batch.imported[:, k].tolist(), batch.exported[:, k].tolist(), strict=True))
        return done

    def _close(self) -> list[dict[str, Any]]:
        assert self._second is not None
        readings = {f"L{phase}": pair for phase, pair in enumerate(self._registers, start=1)}
        readings["total"] = (sum(pair[0] for pair in self._registers), sum(pair[1] for pair in self._registers))
        summaries = [_summary(rows, self._second, *readings[channel]) for channel, rows in self._rows.items()]
        self._rows.clear()
        return summaries


def _summary(rows: list[PowerRow], second: int, imported: float, exported: float) -> dict[str, Any]:
    last = rows[-1]
    P, S = _mean([row.P for row in rows]), _mean([row.S for row in rows])
    return {
        "device": last.device,
        "channel": last.channel,
        "boot": last.boot,
        "seq": last.seq,
        "time": rfc3339(second * 1_000_000_000),
        "rows": len(rows),
        "Vrms": _rms([row.Vrms for row in rows]),
        "Irms": _rms([row.Irms for row in rows]),
        "P": P,
        "P_min": min((row.P for row in rows if row.P is not None), default=None),
        "P_max": max((row.P for row in rows if row.P is not None), default=None),
        "S": S,
        "PF": P / S if P is not None and S else None,
        "f": _mean([row.f for row in rows]),
        "W": last.W,
        "W_import": imported,
        "W_export": exported,
        "flags": sorted({flag for row in rows for flag in row.flags}),
        "schema": last.schema,
    }


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.fsum(known) / len(known) if known else None


def _rms(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.sqrt(math.fsum(value * value for value in known) / len(known)) if known else None
