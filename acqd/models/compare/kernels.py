"""Learned convolution kernels beside known ones: shape and frequency response (what the thesis left open)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats

_FREQUENCIES = 256


def difference_of_gaussian(length: int) -> Floats:
    """[length] first derivative of a Gaussian, norm 1 (Eq. 7.18); for length 3 the centred difference."""
    t = np.arange(length) - length // 2
    kernel = t * np.exp(-(t**2) / (2 * (length / 5) ** 2))
    return np.asarray(kernel / np.linalg.norm(kernel))


def laplacian_of_gaussian(length: int) -> Floats:
    """[length] second derivative of a Gaussian, without mean, norm 1 (Eq. 7.19)."""
    t = np.arange(length) - length // 2
    spread = (length / 5) ** 2
    kernel = (t**2 / spread - 1) * np.exp(-(t**2) / (2 * spread))
    kernel = kernel - kernel.mean()
    return np.asarray(kernel / np.linalg.norm(kernel))


def response(kernel: Floats, step_s: float) -> tuple[Floats, Floats]:
    """Frequency [Hz] and magnitude of the response."""
    f = np.linspace(0, 0.5 / step_s, _FREQUENCIES)
    t = (np.arange(len(kernel)) - len(kernel) // 2) * step_s
    return f, np.abs(np.exp(-2j * np.pi * np.outer(f, t)) @ kernel)


@dataclass(frozen=True, slots=True)
class Likeness:
    """Shares of a kernel's energy."""

    smoothing: float
    """In its mean."""
    first: float
    """Along the difference of Gaussian."""
    second: float
    """Along the Laplacian of Gaussian."""
    rest: float

    @property
    def name(self) -> str:
        """What it is most like, if that is more than half of it."""
        shares = {"angle": self.smoothing, "velocity": self.first, "acceleration": self.second}
        best = max(shares, key=lambda name: shares[name])
        return best if shares[best] > 0.5 else "mixed"


def likeness(kernel: Floats) -> Likeness:
    """The three references are orthogonal: constant, odd, even without mean."""
    total = float(kernel @ kernel) or 1.0
    length = len(kernel)
    flat = np.full(length, 1 / np.sqrt(length))
    references = (flat, difference_of_gaussian(length), laplacian_of_gaussian(length))
    smoothing, first, second = (float(kernel @ reference) ** 2 / total for reference in references)
    return Likeness(smoothing, first, second, max(0.0, 1 - smoothing - first - second))
