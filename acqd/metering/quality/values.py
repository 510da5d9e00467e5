"""Every quantity of an aggregation interval: name, unit, and how longer intervals are made of shorter ones."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from acqd.arrays import Floats

Kind = Literal["10/12", "150/180", "10min", "2h", "10s", "Pst", "Plt"]
KINDS: tuple[Kind, ...] = ("10/12", "150/180", "10min", "2h", "10s", "Pst", "Plt")
Rule = Literal["rms", "mean", "angle", "under", "over"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """One quantity of a row."""

    unit: str
    rule: Rule
    """rms: square root of the mean square (IEC 61000-4-30, section 4.5); mean: of what has a sign or is a power;
    angle: of the mean of unit phasors; under, over: distance of that root of magnitudes in % from 100 %, of what lies
    below and above (IEC 61000-4-30, section 5.12)."""


_RMS_V, _RMS_A, _SHARE = Quantity("V", "rms"), Quantity("A", "rms"), Quantity("%", "rms")
_V, _A, _W = Quantity("V", "mean"), Quantity("A", "mean"), Quantity("W", "mean")
_VA, _VAR, _DEGREE = Quantity("VA", "mean"), Quantity("var", "mean"), Quantity("deg", "angle")

PHASE: dict[str, Quantity] = {
    "Vrms": _RMS_V, "Irms": _RMS_A, "P": _W, "S": _VA,
    "V1": _RMS_V, "I1": _RMS_A, "V1_angle": _DEGREE, "I1_angle": _DEGREE,
    "P1": _W, "Q1": _VAR, "S1": _VA,
    "V_dc": _V, "I_dc": _A, "V_crest": Quantity("", "rms"), "I_crest": Quantity("", "rms"),
    "V_thds": _SHARE, "I_thds": _SHARE, "V_ms": _RMS_V,
    "V_under": Quantity("%", "under"), "V_over": Quantity("%", "over"),
    "Pst": Quantity("", "mean"), "Plt": Quantity("", "mean"),
}  # fmt: skip
"""Quantities of one phase, [phases]."""

LISTS: dict[str, Quantity] = {
    "V_h": _RMS_V,
    "I_h": _RMS_A,
    "V_ih": _RMS_V,
    "I_ih": _RMS_A,
    "V_ig": _RMS_V,
    "I_ig": _RMS_A,
    "V_h_angle": _DEGREE,
    "I_h_angle": _DEGREE,
    "P_h": _W,
    "V_lines": _RMS_V,
    "I_lines": _RMS_A,
    "V_bands": _RMS_V,
    "I_bands": _RMS_A,
    "V_bands_1k": _RMS_V,
    "I_bands_1k": _RMS_A,
}
"""Lists of one phase, [phases, 50]: harmonic subgroups 1 .. 50, interharmonic centred subgroups 0 .. 49, interharmonic
groups 0 .. 49; angles and active powers of harmonics 1 .. 50. [phases, 21], [phases, 35], [phases, 7]: lines up to
100 Hz, bands of 200 Hz and of 1 kHz (`bands`)."""

SYSTEM: dict[str, Quantity] = {
    "Vrms": _RMS_V, "Irms": _RMS_A, "P": _W, "S": _VA, "Se": _VA,
    "P1": _W, "Q1": _VAR, "S1": _VA,
    "V_12": _RMS_V, "V_23": _RMS_V, "V_31": _RMS_V,
    "V_pos": _RMS_V, "V_u2": _SHARE, "V_u0": _SHARE, "I_u2": _SHARE, "I_u0": _SHARE,
    "I_n_derived": _RMS_A, "rotation": Quantity("", "mean"),
}  # fmt: skip
"""Quantities of all phases together."""


@dataclass(frozen=True, slots=True)
class QualityValues:
    """The quantities of one aggregation interval; NaN where a quantity does not exist."""

    kind: Kind
    utc_ns: int
    """UTC of the start."""
    duration: float
    """s."""
    intervals: int
    """10/12-cycle intervals in it."""
    f: float
    """Hz: mean over the interval."""
    rocof: float
    """Hz/s."""
    phase: dict[str, Floats]
    """Of PHASE and LISTS."""
    system: dict[str, float]
    """Of SYSTEM; empty for one phase."""
    flags: frozenset[str]
    """Of the whole system."""
    phase_flags: list[frozenset[str]] = field(default_factory=list)
    """Besides these, of one phase."""
    _numbers: Floats | None = field(default=None, init=False, repr=False, compare=False)

    def numbers(self) -> Floats:
        """Those of `phase`, those of `system`, f and its rate of change in a row: made once for all aggregates."""
        if self._numbers is None:
            ends = [*self.system.values(), self.f, self.rocof]
            row = np.concatenate((*self.phase.values(), ends), axis=None)
            object.__setattr__(self, "_numbers", row)
        assert self._numbers is not None
        return self._numbers
