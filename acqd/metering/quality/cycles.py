"""f, its rate of change and phase jumps of an interval, from one phasor per cycle.

Every cycle of the interval is projected on the fundamental at a trial frequency; the phases of the phasors, all phases
of the system together (weights |c|^2), are fitted with a parabola. Its slope corrects the trial, until nothing is left:
then the phase at the end of the interval is that at its start plus whole cycles, also while f changes. The curvature is
the rate of change of frequency (ROCOF). A step of the phase within the interval is a separate regressor, so that a
jump does not move f.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.metering.interval import interval_sums
from acqd.metering.kernel.compiled import as_rows, quality_library, rows_of

Phasors = NDArray[np.complex128]

MIN_PURITY = 0.5
"""Share of the AC power that the fundamental of a mains voltage carries at least."""
JUMP = 0.01
"""rad; a smaller step is not told from a change of f."""
BEAT = 0.005
"""Hz by which f differs when a beat of one period per interval is fitted too: then an interharmonic near f, or f that
does not change steadily, may move it."""
_CLEARER = 8.0  # a jump leaves so much less of the squares than a parabola alone
_STEPS = 6
_CLOSE = 1e-4  # Hz


@dataclass(frozen=True, slots=True)
class CycleFit:
    """What the cycles of one interval say."""

    f: float
    """Hz, mean over the interval; NaN where no fundamental is credible."""
    rocof: float
    """Hz/s."""
    jump: float
    """rad; 0 without a jump."""
    beats: bool = False
    """Whether the phase swings within the interval, so that f is not sure."""
    phasors: Phasors | None = None
    """[phases, cycles] RMS, against a cosine of the last trial f that begins with the interval."""
    trial: float = np.nan
    """Hz: this f."""
    phases: Floats = field(default_factory=lambda: np.empty(0))
    """[cycles] rad: of all phases of the system together, against the first cycle, unwrapped."""

    @property
    def credible(self) -> bool:
        """Whether there is a fundamental."""
        return self.f == self.f


NONE = CycleFit(np.nan, np.nan, 0.0)


def fit_cycles(u: Floats, start: float, f: float, rate: float, cycles: int, dead: Floats) -> CycleFit:
    """Fit the interval of `u` [phases, samples] that begins at `start` samples; `f` [Hz] is about right.

    `dead` [phases]: RMS of a voltage that counts as absent. NONE where the interval does not lie inside `u`, or holds a
    cycle without voltage.
    """
    found = NONE
    for _ in range(_STEPS):
        end = start + cycles * rate / f
        if not np.isfinite(end) or end + 1 > u.shape[1]:
            return NONE
        phasors, phases, purity = cycle_phasors(u, start, f, rate, cycles)
        alive = np.abs(phasors) > dead[:, None]
        if purity < MIN_PURITY or not alive.any(axis=0).all():
            return NONE
        slope, curve, jump = _fit(phases, cycles)
        correction = slope * f / (2 * np.pi)
        beat = abs(float(_slope_with_beat(cycles) @ phases) - slope) * f / (2 * np.pi)
        rocof, beats = 2 * curve * f * f / (2 * np.pi), not jump and beat > BEAT
        found = CycleFit(f + correction, rocof, jump, beats, phasors, f, phases)
        f += correction
        if abs(correction) < _CLOSE:
            break
    return found


def cycle_phasors(u: Floats, start: float, f: float, rate: float, cycles: int) -> tuple[Phasors, Floats, float]:
    """RMS phasors of consecutive cycles, complex [phases, cycles]; the phase of each cycle against the first one
    [cycles] rad, unwrapped, all phases of the system together; the fundamental's share of the AC power.

    In C where there is a compiler (`kernel/quality.c`).
    """
    library = quality_library()
    if library is None:
        return cycle_phasors_by_numpy(u, start, f, rate, cycles)
    u = as_rows(u)
    phasors, angles = np.empty((len(u), cycles), dtype=np.complex128), np.empty(cycles + 1)
    scratch = np.empty(3 * u.shape[1] + cycles)
    address = angles.ctypes.data
    library.acqd_cycle_phasors(
        *rows_of(u), start, rate / f, cycles, scratch.ctypes.data, phasors.ctypes.data, address, address + 8 * cycles
    )
    return phasors, angles[:-1], float(angles[-1])


def cycle_phasors_by_numpy(
    u: Floats, start: float, f: float, rate: float, cycles: int
) -> tuple[Phasors, Floats, float]:
    """The same without C: the reference."""
    length = rate / f
    sums = _cycle_sums(u, start, length, cycles) / length
    phasors = np.asarray(np.sqrt(2) * (sums[0] + 1j * sums[1]))
    ac = sums[3].mean(axis=1) - sums[2].mean(axis=1) ** 2
    purity = float((np.abs(phasors) ** 2).mean(axis=1).sum() / max(float(ac.sum()), 1e-30))
    turns = (phasors[:, :-1].conj() * phasors[:, 1:]).sum(axis=0)
    return phasors, np.concatenate(([0.0], np.cumsum(np.angle(turns)))), purity


def _cycle_sums(u: Floats, start: float, length: float, cycles: int) -> Floats:
    """Integrals over cycles of `u` times cos and -sin, of u and of its square [4, phases, cycles]."""
    edges = np.asarray(start + length * np.arange(cycles + 1))
    first = max(0, int(edges[0]) - 1)
    part = u[:, first : int(edges[-1]) + 2]
    angle = 2 * np.pi / length * (np.arange(part.shape[1]) + 0.5 + first - start)
    turned = np.stack((part * np.cos(angle), part * -np.sin(angle), part, part * part))
    return interval_sums(turned, edges[:-1] - first, edges[1:] - first)


def _fit(phases: Floats, cycles: int) -> tuple[float, float, float]:
    """Slope [rad/cycle] and curvature [rad/cycle^2] of the parabola a + b m + c m^2, and the jump [rad]."""
    inverse, design = _parabola(cycles)
    plain = inverse @ phases
    off = phases - design @ plain
    rest = float(off @ off)
    best = (float(plain[1]), float(plain[2]), 0.0)
    least = rest / _CLEARER
    inverses, left = _with_jump(cycles)
    off = left @ phases
    squares = np.einsum("kc,kc->k", off, off)
    for k in np.flatnonzero(squares < least).tolist():
        values = inverses[k] @ phases
        step = float(values[3])
        if squares[k] < least and abs(step) > JUMP:
            least, best = float(squares[k]), (float(values[1]), float(values[2]), step)
    return best


@lru_cache(maxsize=2)
def _parabola(cycles: int) -> tuple[Floats, Floats]:
    """Pseudo-inverse and design matrix, weights 1 - (m / half)^2: interharmonics far from f move the slope little."""
    m = np.arange(cycles) - (cycles - 1) / 2
    design = m[:, None] ** np.arange(3)
    root = np.sqrt(1 - (m / (cycles / 2 + 0.5)) ** 2)
    return np.asarray(np.linalg.pinv(design * root[:, None]) * root), np.asarray(design)


@lru_cache(maxsize=2)
def _slope_with_beat(cycles: int) -> Floats:
    """Phases times this is the slope of a parabola and a sine of one period per interval."""
    _, parabola = _parabola(cycles)
    turn = 2 * np.pi * (np.arange(cycles) + 0.5) / cycles
    return np.asarray(np.linalg.pinv(np.column_stack((parabola, np.sin(turn), np.cos(turn))))[1])


@lru_cache(maxsize=2)
def _with_jump(cycles: int) -> tuple[list[Floats], Floats]:
    """The same with a step after cycle k, whose phasor is of both sides and left out: pseudo-inverses, the step fourth,
    and [cycles, cycles, cycles] what the fit leaves of the phases."""
    _, parabola = _parabola(cycles)
    m = np.arange(cycles)
    inverses, left = [], []
    for k in range(cycles):
        only = (m == k).astype(float)[:, None]
        step = (m > k).astype(float)[:, None]
        inner = 0 < k < cycles - 1
        design = np.hstack((parabola, step, only) if inner else (parabola, only))
        inverses.append(np.linalg.pinv(design))
        left.append(np.eye(cycles) - design @ inverses[-1])
    return inverses, np.array(left)
