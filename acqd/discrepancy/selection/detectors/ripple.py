"""Torque ripple in the residual: the joint, and the number of periods per turn."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects.effect import Effect, effect_rows
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import SUBSTEPS, Lag
from acqd.residual.whitening import Whitener

_BINS = 8192  # of a turn and a half to each side
_SPAN = 3 * np.pi
_RESOLUTION = 0.01  # periods per turn


@dataclass(frozen=True, slots=True)
class Ripple:
    """A frequency at a joint."""

    joint: int
    """From 0."""
    periods: float
    """Per turn."""

    @property
    def shape(self) -> dict[str, float]:
        """As the effect takes it."""
        return {"joint": self.joint + 1.0, "periods_per_turn": self.periods}


@dataclass(frozen=True, slots=True)
class Travel:
    """How far the joints moved."""

    low: Floats
    """[axes] rad."""
    high: Floats
    """[axes] rad."""

    @property
    def slowest(self) -> Floats:
        """[axes] periods per turn of the slowest ripple that can be told from a spring or an unbalance.

        A fraction of a period over the recorded travel is a curve like any other.
        """
        return np.asarray(THRESHOLDS.ripple_fewest_periods * 2 * np.pi / np.maximum(self.high - self.low, 1e-6))

    @property
    def tried(self) -> int:
        """Number of ripples that can be told from each other: frequencies a period apart over the travel, by joint."""
        least = self.slowest
        apart = least / THRESHOLDS.ripple_fewest_periods
        return max(1, round(float(np.maximum((THRESHOLDS.ripple_most_periods - least) / apart, 1.0).sum())))


def scan(axes: int, scenes: Iterable[Scene], residuals: Iterable[Floats], whitener: Whitener) -> tuple[Ripple, Travel]:
    """The frequency with the largest spectral power over all joints; every scene is visited once.

    The adjoint of whitening, lag and averaging maps the residual to substeps. There, the product with a sine of any
    frequency is a Fourier transform over the joint's angle: one histogram per joint gives all frequencies at once.
    """
    sums, energy = np.zeros((axes, _BINS)), np.zeros((axes, _BINS))
    low, high = np.full(axes, np.inf), np.full(axes, -np.inf)
    for scene, residual in zip(scenes, residuals, strict=True):
        adjoint = _adjoint(residual, whitener, float(scene.model.group("lag")[0]), scene.step_s)
        for joint in range(axes):
            place = ((scene.q[:, joint] + _SPAN) / (2 * _SPAN) * _BINS).astype(int) % _BINS
            weight = adjoint * scene.power_per_torque[:, joint]
            sums[joint] += np.bincount(place, weight, _BINS)
            energy[joint] += np.bincount(place, weight**2, _BINS)
        low, high = np.minimum(low, scene.q.min(axis=0)), np.maximum(high, scene.q.max(axis=0))
    travel = Travel(low, high)
    spectrum = np.abs(np.fft.rfft(sums, axis=1)) ** 2 / np.maximum(energy.sum(axis=1), 1e-12)[:, None]
    periods = np.fft.rfftfreq(_BINS, 2 * _SPAN / _BINS) * 2 * np.pi
    spectrum[(periods < travel.slowest[:, None]) | (periods > THRESHOLDS.ripple_most_periods)] = 0.0
    joint, at = (int(k) for k in np.unravel_index(int(spectrum.argmax()), spectrum.shape))
    around = slice(max(at - 1, 0), at + 2)
    height = spectrum[joint, around]
    return Ripple(joint, float((periods[around] * height).sum() / max(height.sum(), 1e-12))), travel


def refined(
    effect: Effect, ripple: Ripple, travel: Travel, scenes: list[Scene], residuals: list[Floats], whitener: Whitener
) -> Ripple:
    """The frequency near `ripple` that explains most, by a search with halved steps."""
    best, step = ripple, 0.5
    least = float(travel.slowest[ripple.joint])
    score = _explained(effect, best, scenes, residuals, whitener)
    while step > _RESOLUTION:
        tried = [Ripple(ripple.joint, max(best.periods + sign * step, least)) for sign in (-1, 1)]
        scores = [_explained(effect, each, scenes, residuals, whitener) for each in tried]
        if max(scores) > score:
            best, score = tried[int(np.argmax(scores))], max(scores)
        else:
            step /= 2
    return best


def _explained(
    effect: Effect, ripple: Ripple, scenes: list[Scene], residuals: list[Floats], whitener: Whitener
) -> float:
    G, b = np.zeros((2, 2)), np.zeros(2)
    for scene, residual in zip(scenes, residuals, strict=True):
        white = whitener.apply(effect_rows(effect, scene, ripple.shape))
        G += white.T @ white
        b += white.T @ whitener.apply(residual)
    return float(b @ np.linalg.solve(G + 1e-9 * np.eye(2), b))


def _adjoint(residual: Floats, whitener: Whitener, lag_s: float, step_s: float) -> Floats:
    """[N] the adjoint of averaging, lag and whitening, applied to the white residual."""
    white = np.convolve(residual, whitener.taps)[: len(residual)]
    backward = np.convolve(white[::-1], whitener.taps)[len(white) - 1 :: -1]
    at_substeps = np.repeat(backward, SUBSTEPS) / SUBSTEPS
    return np.asarray(Lag(lag_s, step_s).run(at_substeps[::-1, None])[::-1, 0])
