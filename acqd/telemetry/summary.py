"""The 1 s summary: what a dashboard wants instead of 25 rows a second."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from acqd.metering import WindowBatch
from acqd.metering.window import OneWindow, windows_of
from acqd.telemetry.row import PowerRow
from acqd.timestamps import rfc3339

Registers = tuple[float | None, float | None]
"""Imported and exported energy [kWh]; None: the meter has no such register."""


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
        self._rows: dict[str, list[PowerRow]] = defaultdict(list)
        self._registers: dict[str, Registers] = {}
        self._metered: OneWindow | None = None  # where the registers of metered rows are read
        self._second: int | None = None

    def add(self, batch: WindowBatch, rows: Sequence[PowerRow]) -> list[dict[str, Any]]:
        """Take a batch and its rows, window by window; the summaries that they complete."""
        done: list[dict[str, Any]] = []
        channels = len(rows) // max(len(batch), 1)
        for k, one in enumerate(windows_of(batch)):
            done += self._turn(one.utc_ns // 1_000_000_000)
            for row in rows[k * channels : (k + 1) * channels]:
                self._rows[row.channel].append(row)
            self._metered = one
        return done

    def add_rows(self, rows: Iterable[TimedRow]) -> list[dict[str, Any]]:
        """Take rows; the summaries that they complete."""
        done: list[dict[str, Any]] = []
        for timed in rows:
            done += self._turn(timed.utc_ns // 1_000_000_000)
            self._rows[timed.row.channel].append(timed.row)
            self._registers[timed.row.channel] = timed.imported, timed.exported
        return done

    def _turn(self, second: int) -> list[dict[str, Any]]:
        """The summaries of the second before this one."""
        before, self._second = self._second, second
        if before is None or before == second:
            return []
        if self._metered is not None:
            self._registers = _registers(self._metered)
        summaries = [_summary(rows, before, self._registers[channel]) for channel, rows in self._rows.items()]
        self._rows.clear()
        return summaries


def _registers(one: OneWindow) -> dict[str, Registers]:
    """Readings of the channels after a window; the total has the phases' sum."""
    count = len(one.readings) // 2
    imported, exported = one.readings[:count], one.readings[count:]
    phases = {f"L{p + 1}": pair for p, pair in enumerate(zip(imported, exported, strict=True))}
    return {**phases, "total": (sum(imported), sum(exported))}


def _summary(rows: list[PowerRow], second: int, registers: Registers) -> dict[str, Any]:
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
        "W_import": registers[0],
        "W_export": registers[1],
        "flags": sorted({flag for row in rows for flag in row.flags}),
        "schema": last.schema,
    }


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.fsum(known) / len(known) if known else None


def _rms(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.sqrt(math.fsum(value * value for value in known) / len(known)) if known else None
