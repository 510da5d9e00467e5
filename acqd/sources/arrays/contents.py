"""What a file of named arrays and numbers holds.

Nobody says in such a file which array is what: names and units decide, as in any recording.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from acqd.errors import InputError
from acqd.sources.recording.units import CLOCK_NAMES, TIME_NAMES, UnknownUnitError, split_label, unit_of
from acqd.sources.waveform import MOST_BYTES

_TIMES = {name.replace(" ", "").replace("-", "") for name in TIME_NAMES} | {"timevec", "timevector", "times", "tout"}
_MOST_CHANNELS = 64  # of a matrix: what has more columns is a picture or a table of results
_BOMB = 1000  # times a file may be larger unpacked
_SMALL = 1 << 26
_UNIT_BEHIND_SLASH = re.compile(r"[kmuµ]?V|[kmuµ]A")
"""A alone may be a phase, or an input of PicoScope."""


@dataclass(frozen=True, slots=True)
class Signal:
    """One array of a file [samples], which is read when somebody asks."""

    name: str
    length: int
    read: Callable[[], Any]
    unit: str = ""
    step_s: float | None = None
    start_utc_ns: int | None = None
    scale: float = 1.0
    offset: float = 0.0
    unapplied: bool = False
    """The file has a factor whose meaning is not standard."""

    @property
    def is_time(self) -> bool:
        """Whether the name or the unit says so."""
        name, unit = label_of(self.name)
        try:
            found = unit_of(self.unit or unit)
        except UnknownUnitError:
            found = None
        if found is not None:
            return found.quantity == "t"
        key = key_of(name.rpartition("/")[2])
        return key in _TIMES or key in CLOCK_NAMES or "time" in name.lower().replace("_", " ").replace("/", " ").split()

    @property
    def seconds(self) -> float:
        """Per number of an array of times."""
        try:
            found = unit_of(self.unit or label_of(self.name)[1])
        except UnknownUnitError:
            found = None
        if found is not None and found.quantity == "t":
            return found.factor
        return CLOCK_NAMES.get(key_of(self.name.rpartition("/")[2]), 1.0)


@dataclass(slots=True)
class Contents:
    """What a file holds."""

    signals: list[Signal] = field(default_factory=list)
    numbers: dict[str, float] = field(default_factory=dict)
    """Scalars by name."""
    names: dict[str, list[str]] = field(default_factory=dict)
    """Lists of texts by name: names of the columns of a matrix."""
    notes: list[str] = field(default_factory=list)

    def add(self, name: str, shape: tuple[int, ...], read: Callable[[], Any], unit: str = "", **more: Any) -> None:
        """An array of real numbers: a channel, or a matrix of channels."""
        sizes = tuple(size for size in shape if size != 1)
        if len(sizes) == 1:
            self.signals.append(Signal(name, sizes[0], lambda: np.reshape(read(), -1), unit, **more))
        elif len(sizes) == 2 and min(sizes) <= _MOST_CHANNELS:
            across = int(np.argmin(sizes))
            listed = self._column_names(name, sizes[across])
            for k, one in enumerate(listed):
                self.signals.append(
                    Signal(one, sizes[1 - across], lambda k=k: _taken(read(), sizes, k, across), unit, **more)  # type: ignore[misc]
                )
        elif len(sizes) > 1:
            self.notes.append(f"{name} has the shape {shape}: no channels")

    def _column_names(self, name: str, count: int) -> list[str]:
        """Names of the columns of a matrix: those of a list of so many texts, else numbered."""
        lists = [texts for texts in self.names.values() if len(texts) == count]
        if len(lists) == 1:
            return lists[0]
        stem, unit = label_of(name)
        return [f"{stem}{k + 1}" + (f" [{unit}]" if unit else "") for k in range(count)]


def label_of(name: str) -> tuple[str, str]:
    """Name and unit of an array. What stands before a slash is a group or struct (`s/Va`), unless a unit follows."""
    folder, slash, last = name.rpartition("/")
    if not slash or " / " in name or _UNIT_BEHIND_SLASH.fullmatch(last):
        return split_label(name)
    stem, unit = split_label(last)
    return f"{folder}/{stem}", unit


def key_of(name: str) -> str:
    """Letters and digits of a name, in lower case."""
    return "".join(letter for letter in name.lower() if letter.isalnum())


def _taken(array: Any, sizes: tuple[int, int], k: int, across: int) -> Any:
    return np.take(np.reshape(array, sizes), k, axis=across)


def values_of(path: Path, signal: Signal) -> Any:
    """The array of a signal. Raises InputError."""
    try:
        return np.asarray(signal.read())
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes its library raise
        raise InputError(path, f"{signal.name} cannot be read ({_short(error)})") from None


def check_size(path: Path, announced: int) -> None:
    """Raises InputError for arrays that no file of this size holds, and for more than acqd meters in memory."""
    size = path.stat().st_size
    if announced > max(_BOMB * size, _SMALL) or announced > MOST_BYTES:
        raise InputError(
            path,
            f"announces {announced / 1e6:.0f} MB in a file of {size / 1e6:.3g} MB; is it damaged, or a sparse one?",
        )


def damaged(path: Path, kind: str, error: Exception) -> InputError:
    """One line for whatever a library raises on a damaged file."""
    return InputError(path, f"is truncated or no {kind} ({_short(error)})")


def _short(error: Exception) -> str:
    """The first line of what a library says."""
    text = (str(error).splitlines() or [""])[0]
    return text[:120] or type(error).__name__


def scalar(value: Any) -> float | None:
    """The one finite real number in an array; None for anything else."""
    listed = np.asarray(value).reshape(-1)
    if listed.size != 1 or listed.dtype.kind not in "iufb" or not np.isfinite(listed).all():
        return None
    return float(listed[0])
