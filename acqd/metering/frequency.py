"""Mains frequency of the two cycles of a window: linearised harmonic least squares.

With the fundamental's complex amplitude c and its derivative's d at a trial frequency f0 (`trial`), the true frequency
is f0 + Im(d / c) / 2 pi (one Gauss-Newton step of the nonlinear fit, exact to second order). Every step is one inner
product with vectors that depend on f0 alone, so they are computed once per point of a fine frequency grid and kept.
With several phases the steps are averaged with weights |c|^2, which is the maximum-likelihood combination for equal
noise. There are two fits, over the two cycles and over the stretch; `two_fits` makes one f of them.

Zero crossings (21 mHz at 0.1 % noise) and sine fits without harmonics (200 mHz at 10 % H3) do not
reach the 10 mHz of IEC 61000-4-30 class A inside 40 ms; this does.

A phase jump, a large voltage step and a strong interharmonic move f without lowering the credibility of the fit. They
bend the phase: seven one-cycle phasors over the stretch have phases that no parabola fits (`unsteadiness`). A steady
change of f is a parabola, and harmonics cancel over whole cycles. An interharmonic near f bends the phase too little;
`sideband` finds it over many windows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from acqd.arrays import Floats
from acqd.metering.packed import State
from acqd.metering.trial import CYCLES, Trial, make_trial
from acqd.metering.two_fits import TwoFits

F_MIN, F_MAX = 45.0, 65.0
"""Mains frequencies metered [Hz]."""
MARGIN = 1.0
"""Hz the fit may look beyond the range, so that 45.0 Hz itself is not at an edge."""
GRID = 0.02
"""Hz between trial frequencies; the second-order error at half a step is < 0.1 mHz."""
STEPS = 4
"""Gauss-Newton steps at most."""
SLACK = 0.6
"""Grid steps that f may be away from its trial: noise must not make a window swap grid points for ever."""
MIN_PURITY = 0.80
"""Share of the AC power a mains voltage carries in its fundamental."""
STEADY = 0.0014
"""Largest distance [rad] of a one-cycle phasor from the parabola through all phases, 0.08 degrees. A jump of 5 degrees
that moves f by 3 mHz is beyond it; a voltage step of 1 % is not."""
COARSE_RATE = 4_000.0
"""Below this sampling rate [1/s] cycles of few samples bend the phase by themselves, and STEADY is wider."""
_COARSE = np.arange(F_MIN - MARGIN, F_MAX + MARGIN + 0.5, 0.5)  # Hz, grid of a search over the whole range
_POWERS = (np.arange(CYCLES)[:, None] - (CYCLES - 1) / 2) ** np.arange(3)
BEND = np.eye(CYCLES) - _POWERS @ np.linalg.pinv(_POWERS)
"""What a parabola leaves of the phases."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """Frequencies of windows."""

    f: Floats
    """[windows] Hz, mean over the two cycles; NaN where no fundamental is credible."""
    unsteady: np.ndarray
    """[windows] the phase is bent: `f` is not to be trusted."""
    magnitude: Floats
    """[windows] of the fundamental of all phases together, sqrt(sum |c|^2) [digits]."""
    reactive: Floats
    """[phases, windows] of the fundamentals, Im(U conj I) / 2 [digits^2]; NaN without currents, and where f is."""
    bend: Floats
    """[windows] rad: largest distance of a one-cycle phasor's phase from a parabola, all phases together."""
    swell: Floats
    """[windows] half of what ln(magnitude) of the one-cycle phasors varies by."""
    kink: Floats
    """[windows] Hz that a step of f shortly before the end of the cycles would move their mean f by."""
    growth: Floats
    """[windows] the same of ln(magnitude) for the phase."""

    def followed_by(self, other: Estimate) -> Estimate:
        """Of both, one after the other."""
        names = ("f", "unsteady", "magnitude", "reactive", "bend", "swell", "kink", "growth")
        return Estimate(*(np.concatenate((getattr(self, name), getattr(other, name)), axis=-1) for name in names))


@dataclass(slots=True)
class _Fits:
    """Of windows, [windows] each."""

    short: Floats
    """Hz over the two cycles; NaN where the steps did not settle."""
    long: Floats
    """Hz over the stretch."""
    purity: Floats
    grid: np.ndarray
    """Point of the last trial."""
    magnitude: Floats
    kink: Floats
    growth: Floats

    @property
    def credible(self) -> np.ndarray:
        """Whether there is a fundamental in the range."""
        with np.errstate(invalid="ignore"):
            inside = (self.short >= F_MIN - 0.5) & (self.short <= F_MAX + 0.5)
            return np.asarray(inside & (self.purity >= MIN_PURITY))

    def replace(self, at: np.ndarray, other: _Fits) -> None:
        """Other fits of the windows `at`."""
        for name in ("short", "long", "purity", "grid", "magnitude", "kink", "growth"):
            getattr(self, name)[at] = getattr(other, name)


class FrequencyEstimator:
    """Estimates f of many windows at once; remembers the last f as the next trial."""

    def __init__(self, rate: float, samples: int, window: int | None = None) -> None:
        """`samples` consecutive samples at `rate` [1/s] make one estimate; the last `window` of them (all of them where
        that is not given) are the window in which the two cycles lie.
        """
        self._rate = rate
        self._samples = samples
        self._window = window or samples
        self.fits = TwoFits()
        self.steady = STEADY * max(1.0, COARSE_RATE / rate)
        """rad; beyond it f is not to be trusted."""
        self.trial: float | None = None
        """The last credible f [Hz]."""
        angle = 2 * np.pi * np.outer((np.arange(samples) - (samples - 1) / 2) / rate, _COARSE)
        self._lines = np.hanning(samples)[:, None] * np.concatenate((np.cos(angle), np.sin(angle)), axis=1)

    @property
    def samples(self) -> int:
        """Samples one estimate needs."""
        return self._samples

    @property
    def window(self) -> int:
        """Samples at the end of the stretch that are the window."""
        return self._window

    def state(self) -> State:
        """What is known of the stream so far."""
        return {"trial": self.trial, "fits": self.fits.state()}

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self.trial = state["trial"]
        self.fits.restore(state["fits"])

    def reset(self) -> None:
        """Forget the last frequency (stream start, interruption)."""
        self.trial = None
        self.fits.interrupt()

    def estimate(self, u: Floats, ends: np.ndarray) -> Floats:
        """Frequency [Hz] of the windows that end before sample `ends[k]` of `u` [phases, samples].

        Every end must have `self.samples` samples before it. NaN where no fundamental is credible.
        """
        return self.examine(u, ends).f

    def examine(self, u: Floats, ends: np.ndarray, i: Floats | None = None) -> Estimate:
        """As `estimate`, with what else the fundamentals of `u` and `i` [phases, samples] say."""
        windows = _windows(u, ends, self._samples)
        if self.trial is None:
            fits = self._iterate(windows, self._coarse(windows))
        else:
            fits = self._iterate(windows, np.full(len(ends), to_grid(self.trial)))
            lost = np.flatnonzero(~fits.credible)
            if lost.size:  # not near the last frequency: search the whole range, once
                fits.replace(lost, self._iterate(windows[:, lost], self._coarse(windows[:, lost])))
        credible, grid, magnitude = fits.credible, fits.grid, fits.magnitude
        bend, swell = np.full((2, len(credible)), np.inf)
        bend[credible], swell[credible] = self._unsteadiness(windows[:, credible], grid[credible])
        unsteady = credible & (bend > self.steady)
        f = self._joint(fits, unsteady)
        known = f[credible]
        self.trial = float(known[-1]) if known.size else None
        reactive = np.full(windows.shape[:2], np.nan)
        if i is not None and credible.any():
            U = self._fundamentals(windows[:, credible], grid[credible])
            I = self._fundamentals(_windows(i, ends[credible], self._samples), grid[credible])  # noqa: E741
            reactive[:, credible] = (U * I.conj()).imag / 2
        return Estimate(f, unsteady, magnitude, reactive, bend, swell, fits.kink, fits.growth)

    def at(self, point: int) -> Trial:
        """Vectors of grid point `point`."""
        return make_trial(point * GRID, self._rate, self._samples, self._window)

    def _joint(self, fits: _Fits, unsteady: np.ndarray) -> Floats:
        """f of consecutive windows; NaN where none is credible."""
        f = np.full(len(unsteady), np.nan)
        columns = zip(fits.short.tolist(), fits.long.tolist(), fits.credible.tolist(), unsteady.tolist(), strict=True)
        for k, (short, long, credible, bent) in enumerate(columns):
            if credible:
                f[k] = self.fits.joint(short, long)
            if credible and not bent:
                self.fits.note(short, long)
            else:
                self.fits.interrupt()
        return f

    def _iterate(self, windows: Floats, grid: np.ndarray) -> _Fits:
        """Gauss-Newton steps until every window sits on its nearest grid point."""
        phases, count, _ = windows.shape
        grid = grid.copy()
        f, long, kink, growth = np.empty((4, count))
        parts = np.empty((phases, count, 8))
        todo = np.arange(count)
        for _ in range(STEPS):
            here = grid[todo]
            for point in {int(here[0])} if (here == here[0]).all() else set(here.tolist()):
                at = todo[here == point]
                chosen = windows if len(at) == count else windows[:, at]
                parts[:, at] = chosen @ self.at(point).projection.T
            re_c, im_c, re_d, im_d, re_e, im_e, re_k, im_k = np.moveaxis(parts[:, todo], 2, 0)
            # Im(conj(c) d) and |c|^2, summed over the phases; the parts hold -Im.
            turn, slow_turn = (im_c * re_d - re_c * im_d).sum(axis=0), (im_c * re_e - re_c * im_e).sum(axis=0)
            weight = 2 * np.pi * np.maximum((re_c * re_c + im_c * im_c).sum(axis=0), 1e-30)
            exact = here * GRID + turn / weight
            f[todo], long[todo] = exact, here * GRID + slow_turn / weight
            kink[todo] = 2 * np.pi * np.abs((im_c * re_k - re_c * im_k).sum(axis=0)) / weight
            growth[todo] = 2 * np.pi * np.abs((re_c * re_k + im_c * im_k).sum(axis=0)) / weight
            moved = np.abs(exact - here * GRID) > SLACK * GRID
            if not moved.any():
                todo = todo[:0]
                break
            todo = todo[moved]
            grid[todo] = to_grid(np.clip(exact[moved], F_MIN - MARGIN, F_MAX + MARGIN))
        power = (parts[:, :, :2] ** 2).sum(axis=(0, 2)) / 2
        ac = np.einsum("pwn,pwn->w", windows, windows) / self._samples
        ac -= (np.einsum("pwn->pw", windows) ** 2).sum(axis=0) / self._samples**2
        f[todo] = np.nan  # did not settle
        return _Fits(f, long, power / np.maximum(ac, 1e-30), grid, np.sqrt(2 * power), kink, growth)

    def _fundamentals(self, windows: Floats, grid: np.ndarray) -> np.ndarray:
        """Amplitudes, complex [phases, windows]."""
        result = np.empty(windows.shape[:2], dtype=np.complex128)
        for point in set(grid.tolist()):
            at = np.flatnonzero(grid == point)
            parts = windows[:, at] @ self.at(point).projection[:2].T
            result[:, at] = parts[..., 0] - 1j * parts[..., 1]
        return result

    def _unsteadiness(self, windows: Floats, grid: np.ndarray) -> tuple[Floats, Floats]:
        """`bend` and `swell` of an estimate; phases have the weights |c|^2."""
        bend, swell = np.empty(len(grid)), np.empty(len(grid))
        for point in set(grid.tolist()):
            at = np.flatnonzero(grid == point)
            parts = np.tensordot(windows[:, at], self.at(point).phasors, axes=(2, 0))
            phasors = parts[:, :, 0] - 1j * parts[:, :, 1]  # [phases, windows, CYCLES]
            joint = (phasors.mean(axis=2, keepdims=True).conj() * phasors).sum(axis=0)
            size = np.abs(joint)
            bend[at] = np.abs(np.angle(joint) @ BEND).max(axis=1)
            swell[at] = np.log(size.max(axis=1) / np.maximum(size.min(axis=1), 1e-150)) / 2
        return bend, swell

    def _coarse(self, windows: Floats) -> np.ndarray:
        """Grid point of the strongest line of each window's tapered spectrum, to about half a hertz."""
        ac = windows - windows.mean(axis=2, keepdims=True)
        # not with BLAS, whose threads take longer to begin than this takes
        parts = np.einsum("pwn,nk->pwk", ac, self._lines)
        spectrum = (parts**2).sum(axis=0).reshape(-1, 2, len(_COARSE)).sum(axis=1)
        return to_grid(_COARSE[np.argmax(spectrum, axis=1)])


def to_grid(f: Floats | float) -> np.ndarray:
    """Nearest grid point."""
    return np.rint(np.asarray(f) / GRID).astype(np.int64)


def _windows(u: Floats, ends: np.ndarray, samples: int) -> Floats:
    """[phases, windows, samples] ending before `ends`."""
    if len(ends) == 1:
        return u[:, None, ends[0] - samples : ends[0]]
    return np.asarray(sliding_window_view(u, samples, axis=1)[:, ends - samples])
