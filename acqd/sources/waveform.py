"""A recorded waveform in memory, and how a file's channels become U1, I1, U2, I2, U3, I3."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError, UserError
from acqd.metering import StreamFormat
from acqd.metering.block import CodeBits, Codes
from acqd.numerals import whole_number

LATEST_NS = 7_258_118_400_000_000_000
"""2200-01-01 in UTC ns: a later start time is a mistake."""
MOST_BYTES = 4 * 1024**3
"""Of a recording in memory: three phases at 20 kHz for five hours. A file that announces more is not read."""
_LARGEST = 1e12  # V or A: beyond any instrument, and without overflow in powers
QUANTITIES = ("u1", "i1", "u2", "i2", "u3", "i3")
"""Names of channels in a --map."""
LINES = ("u12", "u23", "u31", "u21", "u32", "u13")
"""Names of voltages between lines in a --map, from the first to the second."""


@dataclass(frozen=True, slots=True)
class ChannelMap:
    """What the user says about a file that cannot say it itself."""

    columns: dict[str, str] | None = None
    """Which column, channel name or number (from 0) is u1, i1 ...; None: by name or unit."""
    u_scale: float | None = None
    """V per unit of the file's voltage numbers."""
    i_scale: float | None = None
    """A per unit of the file's current numbers."""
    rate: float | None = None
    """Samples/s, where the file has no clock."""
    f_nominal: float | None = None
    """Declared mains frequency [Hz]; None: the file's, or 50 Hz."""
    encoding: str | None = None
    """Of text and headers; None: UTF-8, else Latin-1."""
    layout: str | None = None
    """Layout of a text export, or path of one; None: recognised from its first lines."""

    @staticmethod
    def parse(text: str, option: str = "--map") -> dict[str, str]:
        """`u1=Va,i1=Ia` -> {"u1": "Va", "i1": "Ia"}. Raises UserError, which names `option`."""
        columns: dict[str, str] = {}
        for item in text.split(","):
            key, equals, column = item.partition("=")
            key = key.strip().lower()
            if not equals or key not in (*QUANTITIES, *LINES) or not column.strip():
                keys = ", ".join((*QUANTITIES, *LINES[:3]))
                raise UserError(f"{option}: {item!r} is not like u1=COLUMN (keys {keys})")
            if column.strip() == "?":
                raise UserError(
                    f"{option}: {key}=? is a place to fill in; put the name or the number of a column there "
                    "(acqd replay --inspect FILE lists them)"
                )
            if key in columns:
                raise UserError(f"{option}: {key} stands twice ({columns[key]} and {column.strip()}); expected once")
            columns[key] = column.strip()
        return columns

    def pairs(self, path: Path, found: dict[str, str]) -> list[tuple[str, str]]:
        """(voltage, current) columns per phase from the user's words or, without them, `found`."""
        columns = self.columns or found
        pairs = []
        for phase in "123":
            u, i = columns.get(f"u{phase}"), columns.get(f"i{phase}")
            if (u is None) != (i is None):
                have, lack = ("u", "i") if i is None else ("i", "u")
                raise InputError(path, f"has {have}{phase} but no {lack}{phase}; power needs both (see --map)")
            if u is not None and i is not None:
                pairs.append((u, i))
        if not pairs:
            raise InputError(path, "has no voltage and current pair; say which columns with --map u1=...,i1=...")
        return pairs


@dataclass(frozen=True, slots=True)
class Waveform:
    """A whole recording, ready to be replayed."""

    name: str
    codes: Codes
    """[samples, 2 * phases], of the type that `form` says."""
    form: StreamFormat
    start_utc_ns: int | None
    """UTC of the first sample if the file knows it."""
    simulated: bool = False
    """Made by a simulation, and says so: every row of it is flagged."""
    notes: tuple[str, ...] = ()
    """What the user should know about how the file was read."""
    flags: frozenset[str] = frozenset()
    """Flags of every row."""
    breaks: tuple[tuple[int, int], ...] = ()
    """Sample before which samples are missing, and how many: a gap in the rows."""
    marks: tuple[tuple[int, int, frozenset[str]], ...] = ()
    """First sample, sample after the last, and flags of stretches that are no measurements."""

    @property
    def duration(self) -> float:
        """Seconds, with what is missing."""
        return (len(self.codes) + sum(lost for _, lost in self.breaks)) / self.form.rate


def positions(path: Path, names: list[str], pairs: list[tuple[str, str]], kind: str) -> list[int]:
    """Places of u1, i1, u2 ... as `position` finds them. Phases may share a voltage.

    Raises InputError for a current that is used twice, or as a voltage.
    """
    places = [position(path, names, name, kind) for pair in pairs for name in pair]
    for place in places[1::2]:
        if places.count(place) > 1:
            twice = " and ".join(QUANTITIES[k] for k, other in enumerate(places) if other == place)
            raise InputError(path, f"{kind} {names[place]!r} is {twice}; expected another {kind} for each (see --map)")
    return places


def position(path: Path, names: list[str], name: str, kind: str) -> int:
    """Place of a column or channel by its name or its number from 0. Raises InputError, also for a name used twice."""
    places = [k for k, other in enumerate(names) if other == name]
    if len(places) == 1:
        return places[0]
    number = whole_number(name)
    if not places and number is not None and number < len(names):
        return number
    if not places and len(bare := [k for k, other in enumerate(names) if other and _is_with_unit(name, other)]) == 1:
        return bare[0]
    listed = ", ".join(f"{k}={other}" for k, other in enumerate(names))
    if places:
        raise InputError(
            path,
            f"has {len(places)} {kind}s with the name {name!r}; use numbers with --map u1=0,... ({kind}s: {listed})",
        )
    raise InputError(path, f"has no {kind} {name!r}; {kind}s are {listed}")


def _is_with_unit(name: str, bare: str) -> bool:
    """Whether `name` is this one as the file writes it, with the unit: `CH1 [V]`, `CH1V`, `Spannung L1 in kV`."""
    tail = name[len(bare) :].strip()
    return name.startswith(bare) and re.fullmatch(r"[\[(<].{1,9}[\])>]|(?:in |/)?[kmuµ]?[VA]", tail) is not None


def check_values(path: Path, values: Floats) -> None:
    """Raises InputError for no samples and for values that no instrument gives."""
    if len(values) == 0:
        raise InputError(path, "has no samples")
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        row, channel = bad[0]
        raise InputError(path, f"sample {row}, {QUANTITIES[channel]}: {values[row, channel]} is not a number")
    if max(values.max(), -values.min()) > _LARGEST:
        raise InputError(path, f"holds values above {_LARGEST:g}; expected V and A")


def stream_format(path: Path, rate: float, scale: list[float], f_nominal: float, codes: Codes) -> StreamFormat:
    """StreamFormat of `codes`, with its complaints named after the file."""
    bits: CodeBits = 16 if codes.dtype == np.int16 else 64
    try:
        return StreamFormat(rate, tuple(scale), f_nominal, bits)
    except ValueError as error:
        remedy = "; is the unit of its times right (time [ms])? --rate overrules it" if "200 Hz" in str(error) else ""
        raise InputError(path, f"{error}{remedy}") from None
