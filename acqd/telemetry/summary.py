"""The 1 s summary: what a dashboard wants instead of 25 rows a second."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from acqd.metering import WindowBatch
from acqd.telemetry.row import PowerRow
from acqd.timestamps import rfc3339


@dataclass(frozen=True, slots=True)
class TimedRow:
    """A row with what a summary needs besides it."""

    row: PowerRow
    utc_ns: int
    imported: float | None
    """Energy register at the row's end [kWh]; None: the meter has no such register."""
    exported: float | None


class Summariser:
    """Collects rows of one device until the stream's UTC second changes, then gives one summary per channel."""

    def __init__(self) -> None:
        self._rows: dict[str, list[TimedRow]] = defaultdict(list)
        self._second: int | None = None

    def add(self, batch: WindowBatch, rows: Iterable[PowerRow]) -> list[dict[str, Any]]:
        """Take a batch and its rows; the summaries that they complete."""
        return self.add_rows(_timed(batch, rows))

    def add_rows(self, rows: Iterable[TimedRow]) -> list[dict[str, Any]]:
        """Take rows; the summaries that they complete."""
        done: list[dict[str, Any]] = []
        for timed in rows:
            second = timed.utc_ns // 1_000_000_000
            if self._second is not None and second != self._second:
                done += self._close()
            self._second = second
            self._rows[timed.row.channel].append(timed)
        return done

    def _close(self) -> list[dict[str, Any]]:
        assert self._second is not None
        summaries = [_summary(rows, self._second) for rows in self._rows.values()]
        self._rows.clear()
        return summaries


def _timed(batch: WindowBatch, rows: Iterable[PowerRow]) -> Iterator[TimedRow]:
    """Rows with the register readings of their window; the total has the phases' sum."""
    window = {seq: k for k, seq in enumerate(batch.seq.tolist())}
    utc, imported, exported = batch.utc_ns.tolist(), batch.imported.tolist(), batch.exported.tolist()
    every = range(len(imported))
    phase = {f"L{number + 1}": [number] for number in every}
    for row in rows:
        k, which = window[row.seq], phase.get(row.channel, every)
        yield TimedRow(row, utc[k], sum(imported[p][k] for p in which), sum(exported[p][k] for p in which))


def _summary(timed: list[TimedRow], second: int) -> dict[str, Any]:
    rows, last = [one.row for one in timed], timed[-1].row
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
        "W_import": timed[-1].imported,
        "W_export": timed[-1].exported,
        "flags": sorted({flag for row in rows for flag in row.flags}),
        "schema": last.schema,
    }


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.fsum(known) / len(known) if known else None


def _rms(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.sqrt(math.fsum(value * value for value in known) / len(known)) if known else None
