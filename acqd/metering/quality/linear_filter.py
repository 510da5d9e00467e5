"""Analogue transfer functions as digital filters, and filtering of long signals with numpy alone.

A filter of order n in state space (x' = A x + B u, y = C x + D u) maps L inputs and a state to L outputs and the next
state: four small matrices. Whole signals are then products of matrices, with one step in Python per L samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.metering.kernel.compiled import as_rows, quality_library, rows_of

_BLOCK = 64
_MOST_STATES = 32
"""Of a filter in C."""


@dataclass(frozen=True, slots=True)
class Section:
    """H(z) = (b0 + b1/z + b2/z^2) / (1 + a1/z + a2/z^2)."""

    b: tuple[float, float, float]
    a: tuple[float, float]


def bilinear(numerator: Sequence[float], denominator: Sequence[float], rate: float, match: float = 0.0) -> Section:
    """H(s) of up to second order, coefficients of s^2, s and 1, as a section at `rate` [1/s].

    The numerator has no higher order than the denominator. `match` [Hz]: where both agree exactly; the bilinear
    transform bends all other frequencies.
    """
    w = np.pi * match / rate
    c = 2 * rate if match <= 0 else 2 * np.pi * match / np.tan(w)

    def expand(coefficients: Sequence[float]) -> Floats:
        s2, s1, s0 = (*([0.0] * (3 - len(coefficients))), *coefficients)
        if len(denominator) < 3:  # of first order: no pole and zero at half the rate that only cancel
            return np.array([s1 * c + s0, s0 - s1 * c, 0.0])
        return np.array([s2 * c * c + s1 * c + s0, 2 * (s0 - s2 * c * c), s2 * c * c - s1 * c + s0])

    b, a = expand(numerator), expand(denominator)
    b, a = b / a[0], a / a[0]
    return Section((float(b[0]), float(b[1]), float(b[2])), (float(a[1]), float(a[2])))


def butterworth(order: int, cut_off: float, rate: float) -> list[Section]:
    """Low pass of even `order`, -3 dB at `cut_off` [Hz]."""
    w = 2 * np.pi * cut_off
    damping = [2 * np.sin(np.pi * (2 * k + 1) / (2 * order)) for k in range(order // 2)]
    return [bilinear([w * w], [1.0, d * w, w * w], rate, match=cut_off) for d in damping]


class LinearFilter:
    """Sections one after the other, for several channels at once; keeps its state between calls."""

    def __init__(self, sections: Sequence[Section], channels: int) -> None:
        A, B, C, D = _in_series(sections)
        outputs, states = [C], [B]
        for _ in range(_BLOCK - 1):
            outputs.append(outputs[-1] @ A)
            states.append(A @ states[-1])
        response = np.array([D, *(C @ b for b in states[:-1])])  # of an impulse
        ages = np.arange(_BLOCK)[:, None] - np.arange(_BLOCK)
        self._forced = np.where(ages >= 0, response[np.abs(ages)], 0.0).T.copy()
        self._free = np.array(outputs).T.copy()
        self._gain = np.array(states[::-1])
        self._keep = (A @ np.linalg.matrix_power(A, _BLOCK - 1)).T.copy()
        self._one = (A.T.copy(), B, C, D)
        self._in_c = np.ascontiguousarray(A), np.ascontiguousarray(B), np.ascontiguousarray(C), float(D)
        self._state = np.zeros((channels, len(B)))

    def settle(self, level: Floats) -> None:
        """The state after `level` [channels] has been the input for ever."""
        A, B = self._one[0].T, self._one[1]
        self._state = np.ascontiguousarray(np.outer(level, np.linalg.solve(np.eye(len(B)) - A, B)))

    def feed(self, u: Floats) -> Floats:
        """Output of [channels, samples]; in C where there is a compiler (`kernel/quality.c`)."""
        library = quality_library()
        if library is None or self._state.shape[1] > _MOST_STATES:
            return self.feed_by_numpy(u)
        u = as_rows(u)
        A, B, C, D = self._in_c
        y = np.empty(u.shape)
        library.acqd_filter(
            A.ctypes.data, B.ctypes.data, C.ctypes.data, D, len(B), self._state.ctypes.data, *rows_of(u), y.ctypes.data
        )
        return y

    def feed_by_numpy(self, u: Floats) -> Floats:
        """The same without C: the reference."""
        channels, count = u.shape
        whole = count // _BLOCK * _BLOCK
        y = np.empty_like(u)
        if whole:
            y[:, :whole] = self._blocks(u[:, :whole].reshape(channels, -1, _BLOCK)).reshape(channels, whole)
        A, B, C, D = self._one
        for k in range(whole, count):
            y[:, k] = self._state @ C + D * u[:, k]
            self._state = self._state @ A + u[:, k, None] * B
        return y

    def _blocks(self, u: Floats) -> Floats:
        pushed = u @ self._gain  # [channels, blocks, order]
        states = np.empty_like(pushed)
        state = self._state
        for k in range(u.shape[1]):
            states[:, k] = state
            state = state @ self._keep + pushed[:, k]
        self._state = state
        return np.asarray(u @ self._forced + states @ self._free)


def _in_series(sections: Sequence[Section]) -> tuple[Floats, Floats, Floats, float]:
    """State space of sections in a row, each one in its transposed direct form."""
    A, B, C, D = np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    for section in sections:
        b0, b1, b2 = section.b
        a1, a2 = section.a
        own, drive = np.array([[-a1, 1.0], [-a2, 0.0]]), np.array([b1 - a1 * b0, b2 - a2 * b0])
        size = len(B)
        joined = np.zeros((size + 2, size + 2))
        joined[:size, :size], joined[size:, :size], joined[size:, size:] = A, np.outer(drive, C), own
        A, B = joined, np.concatenate((B, drive * D))
        C, D = np.concatenate((b0 * C, [1.0, 0.0])), b0 * D
    return A, B, C, D
