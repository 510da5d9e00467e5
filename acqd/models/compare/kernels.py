"""Learned convolution kernels compared with known differentiators: shape and frequency response."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats

_FREQUENCIES = 256


def difference_of_gaussian(length: int) -> Floats:
    """First derivative of a Gaussian [length], norm 1 (thesis Eq. 7.18); for length 3 the central difference."""
    t = np.arange(length) - length // 2
    kernel = t * np.exp(-(t**2) / (2 * (length / 5) ** 2))
    return np.asarray(kernel / np.linalg.norm(kernel))


def laplacian_of_gaussian(length: int) -> Floats:
    """Second derivative of a Gaussian [length], zero mean, norm 1 (thesis Eq. 7.19)."""
    t = np.arange(length) - length // 2
    spread = (length / 5) ** 2
    kernel = (t**2 / spread - 1) * np.exp(-(t**2) / (2 * spread))
    kernel = kernel - kernel.mean()
    return np.asarray(kernel / np.linalg.norm(kernel))


def response(kernel: Floats, step_s: float) -> tuple[Floats, Floats]:
    """Frequency [Hz] and magnitude of the frequency response, up to half the sampling rate."""
    f = np.linspace(0, 0.5 / step_s, _FREQUENCIES)
    t = (np.arange(len(kernel)) - len(kernel) // 2) * step_s
    return f, np.abs(np.exp(-2j * np.pi * np.outer(f, t)) @ kernel)


@dataclass(frozen=True, slots=True)
class Likeness:
    """Shares of a kernel's squared norm along three orthogonal reference kernels."""

    smoothing: float
    """Along the constant kernel."""
    first: float
    """Along the difference of Gaussian (DoG)."""
    second: float
    """Along the Laplacian of Gaussian (LoG)."""
    rest: float
    """Along none of them."""

    @property
    def name(self) -> str:
        """Quantity that the kernel computes by more than half of its squared norm, else "mixed"."""
        shares = {"angle": self.smoothing, "velocity": self.first, "acceleration": self.second}
        best = max(shares, key=lambda name: shares[name])
        return best if shares[best] > 0.5 else "mixed"


def likeness(kernel: Floats) -> Likeness:
    """Project a kernel on the references, which are orthogonal: constant, odd, and even with zero mean."""
    total = float(kernel @ kernel) or 1.0
    length = len(kernel)
    flat = np.full(length, 1 / np.sqrt(length))
    references = (flat, difference_of_gaussian(length), laplacian_of_gaussian(length))
    smoothing, first, second = (float(kernel @ reference) ** 2 / total for reference in references)
    return Likeness(smoothing, first, second, max(0.0, 1 - smoothing - first - second))
