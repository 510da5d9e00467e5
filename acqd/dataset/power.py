"""The power stream: rows from SQL, CSV, JSON lines or Parquet, sorted, and not limited by memory."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import sqlalchemy as sa
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.dataset.local_clock import LocalClock
from acqd.dataset.power_source import PowerRows
from acqd.dataset.power_sql import read_database
from acqd.dataset.power_values import (
    interpolated_every,
    no_value_note,
    no_values,
    range_note,
    refreshed_every,
    two_meters_note,
)
from acqd.errors import InputError, UserError
from acqd.robot.row_clock import even_times
from acqd.rounded_times import rebuilt_times, shared_stamps
from acqd.storage.url import shown
from acqd.timestamps import SINCE_1970_S, Nanoseconds

Measured = Literal["mains", "bus", "derived", "simulated"]
"""Where P comes from: a meter, the controller's measurement of the robot's supply, a computation from other
measurements (currents), or a simulation."""
_LABELS: tuple[Measured, ...] = ("simulated", "derived")  # flags of rows that say so
FILES = (".parquet", ".jsonl", ".json", ".ndjson", ".csv", ".txt")
"""Files of rows. Parquet needs pyarrow; the others, and databases, need nothing more than acqd."""
_ROW = np.dtype([("time", np.int64), ("P", np.float64), ("Vrms", np.float64)])
_MOST_UNSURE_S = 0.5
"""Error of all times from which on no lag can be read."""
_FASTEST_NS = 1e5
_PAUSE_S = 5.0
"""Step that is a gap, not a late row."""
_SAMPLE = 100
_RISES = 0.5
"""Share of the rows in which a register of energy grows."""
_IN_PACKETS = 0.1
"""Usual step over the mean one, below which rows may come in packets."""
_FEWEST_PACKETS = 10
_ALIKE, _MOSTLY = 0.3, 0.8
"""Difference of packets and of the steps between them, and the share of them, up to which they are alike."""
_UNUSUAL = 5.0
"""Usual steps, beyond which a step is a gap or of another rate, not a late row."""
_UNEVEN, _MOST_STEPS = 0.25, 90
"""Difference of steps, over the usual one, that is noted, and the percentile that must differ so much."""
_SLOWEST_S = 0.25
"""Longest step between rows that are aligned with a motion."""
_WINDOW_ROWS = 100_000  # of which the window's length is the median step


@dataclass(frozen=True, slots=True)
class PowerStream:
    """Rows of one channel of one device at rising times without duplicates."""

    time_ns: Nanoseconds
    """[N] UTC of each window's first sample."""
    P: Floats
    """[N] W; NaN where the row's flags make it unusable."""
    Vrms: Floats
    """[N] V; NaN where unknown."""
    window_ns: int
    """Length of a window: the median step."""
    dropped: int
    """Duplicates left out."""
    measured: Measured
    origin: str
    """URL or file of the rows."""
    notes: tuple[str, ...] = ()
    """What the user should know about the times of the rows."""
    stamp_error_s: float = 0.0
    """By how much all times may be wrong together, because their digits were cut off or rounded."""
    coarse: bool = False
    """Whether most rows were made between measured ones, so that fast changes are lost."""

    @property
    def fast(self) -> bool:
        """Whether the rows are close enough to be aligned with a motion."""
        return self.window_ns * 1e-9 <= _SLOWEST_S

    def part(self, begin_ns: int, end_ns: int) -> slice:
        """Rows whose windows start from `begin_ns` up to, not including, `end_ns`."""
        first, last = np.searchsorted(self.time_ns, (begin_ns, end_ns))
        return slice(int(first), int(last))


def open_power(
    origin: str,
    device: str | None,
    channel: str | None,
    between_ns: tuple[int, int] | None = None,
    engine: sa.Engine | None = None,
    zone: str | None = None,
) -> PowerStream:
    """Rows of a device and channel (None: the only device; total, or the only channel) from a URL or file.

    Raises UserError.

    They go into a temporary file that is mapped, so that a stream may be larger than memory. `between_ns` (UTC) asks
    a database for a part only; `engine` is that database if it is open already. `zone` (IANA, such as Europe/Berlin) is
    that of times in a file that name none.
    """
    clock = LocalClock(origin, zone)
    path, notes = Path(origin), list[str]()
    shown_origin = origin
    if "://" in origin or path.suffix in (".sqlite", ".db", ".sqlite3"):
        blocks = read_database(origin, device, channel, between_ns, engine)
        shown_origin = shown(origin)  # reports and manifests must not hold a password
    elif path.suffix in FILES:
        from acqd.dataset.power_files import read_file

        blocks = read_file(path, device, channel, notes)
    elif "@" in origin:
        raise UserError("power: the URL cannot be understood; expected postgresql://user@host/name")
    else:
        from acqd.dataset.power_files import known_format

        expected = "expected an SQL URL, or a .sqlite, .csv, .jsonl or .parquet file"
        found = known_format(path) if path.is_file() else "is a folder" if path.is_dir() else "no such file"
        raise UserError(f"power {origin}: {'; '.join(filter(None, (found, expected)))}")
    return _spool(shown_origin, blocks, clock, notes)


def _spool(origin: str, blocks: Iterator[PowerRows], clock: LocalClock, notes: list[str]) -> PowerStream:
    """`notes`: what reading the blocks says."""
    flags: set[str] = set()
    without_zone: set[bool] = set()
    with tempfile.TemporaryFile(prefix="acqd-power-") as file:
        for block in blocks:
            rows = np.empty(len(block.time_ns), dtype=_ROW)
            utc_ns = clock.utc(block.time_ns) if block.without_zone else block.time_ns
            rows["time"], rows["P"], rows["Vrms"] = utc_ns, block.P, block.Vrms
            file.write(rows.tobytes())
            flags |= block.flags
            without_zone.add(block.without_zone)
        file.flush()
        if file.tell() < 3 * _ROW.itemsize:
            raise UserError(f"power {origin}: fewer than three rows of that device and channel")
        mapped: NDArray[np.void] = np.memmap(
            file, dtype=_ROW, mode="c"
        )  # times may be rebuilt: in memory, page by page
    if len(without_zone) > 1:
        raise UserError(f"power {origin}: some times have a zone and others have none: write the zone in every row")
    notes += clock.notes()
    _require_power_not_time(origin, mapped["time"], mapped["P"])
    stamp_error_s = _rebuild_shared_times(origin, mapped, notes)
    time_ns = mapped["time"]
    dropped = 0
    if (np.diff(time_ns) <= 0).any():
        _, order = np.unique(time_ns, return_index=True)  # sorts; of equal times the first is kept
        dropped = len(time_ns) - len(order)
        mapped = mapped[order]
        time_ns = mapped["time"]
    if len(time_ns) < 3:
        raise UserError(f"power {origin}: fewer than three rows of that device and channel at different times")
    stamp_error_s += _even_out(origin, time_ns, notes)
    step_ns = float(np.median(np.diff(time_ns[:_WINDOW_ROWS])))
    if step_ns < _FASTEST_NS:
        raise InputError(
            origin,
            f"most of its rows are {step_ns * 1e-9:.3g} s apart: is its time in days, or in another unit? Write s",
        )
    window_ns = round(step_ns / 1000) * 1000  # times in files are often rounded to microseconds
    known = mapped["P"][np.isfinite(mapped["P"])]
    if len(known) < 3 or np.ptp(known) == 0.0:
        raise UserError(f"power {origin}: P is constant or missing; is this the robot's channel?")
    changes = np.diff(known)
    if len(known) >= _SAMPLE and (changes >= 0).all() and (changes > 0).mean() > _RISES:
        raise InputError(origin, "P never falls: is it the register of an energy? Expected the power of each row, W")
    measured: Measured = next((label for label in _LABELS if label in flags), "mains")
    repeated_s = _doubt_values(origin, mapped["P"], window_ns, notes)
    made_s = 0.0 if repeated_s else _made_rows(origin, mapped["P"], window_ns, notes)
    stamp_error_s += repeated_s + made_s
    return PowerStream(
        time_ns,
        mapped["P"],
        mapped["Vrms"],
        window_ns,
        dropped,
        measured,
        origin,
        tuple(notes),
        stamp_error_s,
        made_s > 0,
    )


def _require_power_not_time(origin: str, time_ns: Nanoseconds, P: Floats) -> None:
    """Raises InputError where P is a clock, at more W than any robot takes, and the time is not: exchanged columns."""
    if len(P) >= _SAMPLE and P[0] > SINCE_1970_S and (np.diff(P) >= 0).all() and (np.diff(time_ns) < 0).any():
        raise InputError(origin, f"P rises from {P[0]:.0f} on in every row, time does not: are the columns exchanged?")


def _doubt_values(origin: str, P: Floats, window_ns: int, notes: list[str]) -> float:
    """Removes numbers that stand for no value, in place; how late values may be [s] that the meter repeats."""
    nothing = no_values(P)
    if nothing is not None:
        P[nothing[0]] = np.nan
        notes.append(f"power {origin}: {no_value_note(int(nothing[0].sum()), len(P), nothing[1])}")
    notes += [f"power {origin}: {text}" for text in (range_note(P), two_meters_note(P)) if text]
    rows = refreshed_every(P)
    if rows == 1:
        return 0.0
    refresh_s = rows * window_ns * 1e-9
    notes.append(
        f"power {origin}: the meter has a new value every {refresh_s:.2g} s and repeats the last one in between: the "
        f"power is up to so much late, and fast changes are lost; ask it every {refresh_s:.2g} s, or use a faster meter"
    )
    return refresh_s / 2


def _made_rows(origin: str, P: Floats, window_ns: int, notes: list[str]) -> float:
    """By how much all times may be wrong [s] where most rows were made by straight lines between measured ones.

    The measured rows are means over a longer window than that of a row; where in it their time lies is not known.
    """
    rows = interpolated_every(P)
    if rows == 1:
        return 0.0
    row_s = window_ns * 1e-9
    notes.append(
        f"power {origin}: the power changes along straight lines of {rows} rows: rows were made between measured ones "
        f"every {rows * row_s:.2g} s, and all times may be off by {1000 * (rows - 1) * row_s / 2:.0f} ms; give the "
        "rows of the meter as they are"
    )
    return (rows - 1) * row_s / 2


def _even_out(origin: str, time_ns: Nanoseconds, notes: list[str]) -> float:
    """Puts rows that were stamped in packets at even distances, in place; how wrong all times may be [s].

    A row that comes late says nothing of its window. Jitter is only noted: the meter may have been read unevenly.
    """
    steps = np.diff(time_ns[:_WINDOW_ROWS]) * 1e-9
    near = steps[steps < _PAUSE_S]
    if len(near) < _SAMPLE:
        return 0.0
    mean_s, usual_s = float(near.mean()), float(np.median(near))
    if usual_s < _IN_PACKETS * mean_s and _packets(near, usual_s):
        since_s = (time_ns - time_ns[0]) * 1e-9
        even = even_times(since_s, window_s=2 * _PAUSE_S, pauses=np.diff(since_s) >= _PAUSE_S)
        time_ns[:] = time_ns[0] + np.rint(even.time * 1e9).astype(np.int64)
        notes.append(
            f"power {origin}: rows come in packets, most of them {1000 * usual_s:.3g} ms apart: they were put at even "
            f"distances of {1000 * even.row_s:.3g} ms; record the meter's own time"
        )
        return even.error_s
    near = near[near < _UNUSUAL * usual_s]
    uneven_s = float(np.percentile(np.abs(near - usual_s), _MOST_STEPS))
    if uneven_s < _UNEVEN * usual_s:
        return 0.0
    notes.append(
        f"power {origin}: steps between rows differ by {1000 * uneven_s:.2g} ms: if these are times at which rows "
        "came, they are late; record the meter's own time"
    )
    return uneven_s / 2


def _packets(steps: Floats, usual_s: float) -> bool:
    """Whether short steps [s] come in packets of a size, with steps of a length between them.

    A meter that writes slowly while the robot rests, or loses rows, has steps of other lengths and at other distances.
    """
    between = np.flatnonzero(steps > _UNUSUAL * usual_s)
    if len(between) < _FEWEST_PACKETS:
        return False
    sizes, lengths = np.diff(between).astype(float), steps[between]
    usual = float(np.median(sizes))
    alike = [(np.abs(each - np.median(each)) <= _ALIKE * np.median(each)).mean() for each in (sizes, lengths)]
    return usual > 1 and min(alike) >= _MOSTLY


def require_fast(power: PowerStream) -> None:
    """Raises InputError for rows that are too far apart to be aligned with a motion."""
    if not power.fast:
        raise InputError(
            power.origin,
            f"has a row every {power.window_ns * 1e-9:.3g} s, expected one every {_SLOWEST_S} s or faster: no lag can "
            "be read from it; record faster, or give the lag if it is known (--lag)",
        )


def _rebuild_shared_times(origin: str, rows: NDArray[np.void], notes: list[str]) -> float:
    """Puts rows that share a stamp at their times, in place; how wrong all of them may be [s].

    Raises InputError where their rate is not regular.
    """
    since_ns = rows["time"] - rows["time"][0]
    P = rows["P"]
    different = (P[1:] != P[:-1]) & (np.isfinite(P[1:]) | np.isfinite(P[:-1]))
    shared = shared_stamps(since_ns, different)
    if not shared:
        return 0.0
    rebuilt = rebuilt_times(since_ns * 1e-9, shared)
    if rebuilt is None:
        raise InputError(
            origin,
            f"{shared} of {len(rows)} rows have the time of the row before with another power, and their rate is not "
            "regular: are the times written with too few digits, or are these rows of several meters? Expected times "
            "with three decimals, and one row for each",
        )
    if rebuilt.error_s > _MOST_UNSURE_S:
        raise InputError(
            origin,
            f"its times are only written to {rebuilt.stamp_s:.3g} s (as numbers of single precision, say): expected "
            "three decimals",
        )
    notes.append(f"power {origin}: {rebuilt.sentence()}")
    rows["time"] = rows["time"][0] + np.rint(rebuilt.time * 1e9).astype(np.int64)
    return rebuilt.error_s
