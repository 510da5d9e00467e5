"""The sample block: what every source delivers and every meter takes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import NDArray

Codes: TypeAlias = NDArray[np.int16 | np.int32 | np.float64]
CodeBits = Literal[16, 32, 64]

_NONE: frozenset[str] = frozenset()
CODE_MAX = 32767
"""Positive end stop of the 16-bit converter: a sample here is over-range."""
CODE_MIN = -32768
"""Negative end stop of the 16-bit converter."""
WIDE_CODE_MAX = 2**26
"""End stop of 32-bit codes, both ways: 2000 products of such codes, a window's worth, sum up inside 64 bits."""


NOMINAL = ((15.0, 17.5), (45.0, 65.0), (360.0, 440.0))
"""Mains frequencies that are metered [Hz]: railways, 50 and 60 Hz, aircraft."""
NOMINAL_TEXT = "expected 15 to 17.5, 45 to 65, or 360 to 440 Hz"


def nominal_near(f: float) -> float:
    """16 2/3, 50, 60 or 400 Hz: the nominal frequency of mains of `f` [Hz]."""
    return min((50 / 3, 50.0, 60.0, 400.0), key=lambda nominal: abs(nominal - f))


_Class = TypeVar("_Class")


@dataclass_transform(frozen_default=True)
def _frozen_for_type_checkers(cls: type[_Class]) -> type[_Class]:
    """A dataclass that mypy keeps from being changed: frozen at run time, a block takes three times as long to make."""
    return dataclass(slots=True)(cls)


@_frozen_for_type_checkers
class SampleBlock:
    """Consecutive samples of all channels, as converter codes; nobody changes one: stages of a stream share it.

    Channels come in pairs per phase: U1, I1, U2, I2, U3, I3.
    """

    codes: Codes
    """int16, int32 or float64 [samples, 2 * phases], as the stream's format says."""
    index: int
    """Number of the first sample since the stream started; lost samples count."""
    utc_ns: int
    """UTC of the first sample [ns since 1970-01-01]."""
    lost: int = 0
    """Samples lost immediately before this block."""
    flags: frozenset[str] = _NONE
    """Row flags that hold for every window this block touches ("late", "simulated" ...)."""

    def overrange(self, form: StreamFormat) -> bool:
        """Whether a code is at its end stop; double numbers have none, so this is asked before codes become such."""
        if form.bits == 64 or not len(self.codes):
            return False
        return bool(self.codes.max() >= form.code_max or self.codes.min() <= form.code_min)


def code_type(bits: CodeBits) -> np.dtype[np.int16 | np.int32 | np.float64]:
    """Type of codes of this width."""
    if bits == 64:
        return np.dtype(np.float64)
    return np.dtype(np.int32) if bits == 32 else np.dtype(np.int16)


@dataclass(frozen=True, slots=True)
class StreamFormat:
    """What the codes of one stream mean; constant while the stream lasts."""

    rate: float
    """Sampling rate [samples/s]."""
    scale: tuple[float, ...]
    """Physical units per code and channel: V for U channels, A for I channels."""
    f_nominal: float = 50.0
    """Declared mains frequency [Hz]."""
    bits: CodeBits = 16
    """Width of a code: 16 for converters, 32 for digital values of a wider range (sampled values, auto range).

    64: recorded physical values as double numbers, which have no end stops."""

    def __post_init__(self) -> None:
        if not 200 <= self.rate <= 1_000_000:
            raise ValueError(f"sampling rate {self.rate:g} Hz is outside 200 Hz .. 1 MHz")
        if len(self.scale) not in (2, 4, 6):
            raise ValueError(f"{len(self.scale)} channels: expected U, I per phase for 1 to 3 phases")
        if not any(low <= self.f_nominal <= high for low, high in NOMINAL):
            raise ValueError(f"nominal frequency {self.f_nominal:g} Hz: {NOMINAL_TEXT}")
        if self.bits == 64:
            self._check_physical()
            return
        for channel, scale in enumerate(self.scale):
            unit, limit = ("A", 1e6) if channel % 2 else ("V", 2e6)
            full_scale = scale * -self.code_min
            if not 1e-3 <= full_scale <= limit:
                raise ValueError(
                    f"channel {self.channel_name(channel)}: full scale {full_scale:g} {unit} "
                    f"is outside 0.001 .. {limit:g} {unit}; check the scale ({scale:g} {unit} per digit)"
                )

    def _check_physical(self) -> None:
        for channel, scale in enumerate(self.scale):
            if not 1e-12 <= scale <= 1e12:
                raise ValueError(f"channel {self.channel_name(channel)}: scale {scale:g} is outside 1e-12 .. 1e12")

    @property
    def usual(self) -> bool:
        """Whether the mains are of 50 or 60 Hz, for which power quality is defined."""
        return NOMINAL[1][0] <= self.f_nominal <= NOMINAL[1][1]

    @property
    def code_max(self) -> float:
        """Positive end stop of the codes."""
        return {16: CODE_MAX, 32: WIDE_CODE_MAX, 64: math.inf}[self.bits]

    @property
    def code_min(self) -> float:
        """Negative end stop of the codes."""
        return {16: CODE_MIN, 32: -WIDE_CODE_MAX, 64: -math.inf}[self.bits]

    @property
    def dtype(self) -> np.dtype[np.int16 | np.int32 | np.float64]:
        """Type of one code."""
        return code_type(self.bits)

    @property
    def phases(self) -> int:
        """Number of metered phases, 1 to 3."""
        return len(self.scale) // 2

    @staticmethod
    def channel_name(channel: int) -> str:
        """U1, I1, U2 ... of a channel number."""
        return f"{'UI'[channel % 2]}{channel // 2 + 1}"
