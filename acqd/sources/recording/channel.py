"""A recording before anybody has said what its channels are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from acqd.arrays import Floats

Kind = Literal["phase", "line", "residual", "dc", "sync", "sequence", "computed", "other", "unknown"]
"""What a channel is: the voltage or current of a phase, a voltage between phases, neutral or residual, direct, the
synchronising voltage of another bus, a symmetrical component, a value computed from samples, another quantity."""
Letter: TypeAlias = Literal["u", "i", ""]
"""Voltage, current; empty: not known."""
UNKNOWN: Letter = ""


@dataclass(frozen=True, slots=True)
class Column:
    """Samples of one channel: value = `values` x scale + offset, in the unit of the file."""

    values: Any
    """int16 codes or double numbers [samples]."""
    scale: float = 1.0
    offset: float = 0.0

    def physical(self) -> Floats:
        """In the unit of the file."""
        return np.asarray(self.values.astype(np.float64) * self.scale + self.offset)


@dataclass(frozen=True, slots=True)
class Channel:
    """What a file says of one channel."""

    name: str
    unit: str = ""
    """As the file writes it."""
    phase: str = ""
    """Field of the phase, where the format has one."""
    circuit: str = ""
    """Field of the circuit, where the format has one."""
    ratio: float = 1.0
    """Primary per recorded quantity, as the file says."""
    skew_s: float = 0.0
    """How much later than the sample's time the channel is sampled [s]."""
    input: bool = False
    """The name is one of an input of the instrument (`U1-2`: unit 1, channel 2) and says no phase."""


@dataclass(frozen=True, slots=True)
class Role:
    """What a channel is, and why."""

    kind: Kind
    quantity: Letter = UNKNOWN
    phases: tuple[int, ...] = ()
    """1 to 3: of a phase; two: from the first to the second."""
    group: str = ""
    """Feeder, winding or bus that the name says."""
    evidence: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """u1, i3, u12 ...; empty for what is not metered."""
        return self.quantity + "".join(map(str, self.phases)) if self.kind in ("phase", "line") else ""

    def title(self) -> str:
        """In words."""
        noun = {"u": "voltage", "i": "current"}.get(self.quantity, "")
        lines = "-".join(f"L{phase}" for phase in self.phases)
        words: dict[Kind, str] = {
            "phase": f"{noun} {lines}",
            "line": f"{noun} {lines}",
            "residual": f"residual or neutral {noun}",
            "dc": f"DC {noun}",
            "sync": "synchronising voltage",
            "sequence": f"symmetrical component of the {noun}",
            "computed": f"computed {noun}".strip(),
            "other": "another quantity",
            "unknown": f"{noun}, phase unknown" if noun else "unknown",
        }
        return words[self.kind].strip()


@dataclass(slots=True)
class Recording:
    """A file that has been read: its channels, samples and clock."""

    path: Path
    format: str
    """Format or layout, for people."""
    channels: list[Channel]
    samples: int
    column: Callable[[int], Column]
    """Samples of a channel. Raises InputError for values that are missing."""
    rate: float | None
    """[1/s]; None: the file does not say."""
    start_utc_ns: int | None = None
    f_nominal: float | None = None
    """Mains frequency that the file declares [Hz]."""
    simulated: bool = False
    notes: list[str] = field(default_factory=list)
    breaks: list[tuple[int, int]] = field(default_factory=list)
    """Sample before which samples are missing, and how many."""
    noun: str = "column"
    """What a channel of this format is called."""
    full_scale: bool = False
    """The format says that integers are codes of a converter, whatever their scale."""
    declared: bool = False
    """The format itself says which channel is which phase."""
    advice: str = ""
    """What to export instead of a file of this format that lacks voltages or currents."""
