"""What 100 % is: the declared voltage, or the sliding reference of IEC 61000-4-30."""

from __future__ import annotations

import math
from typing import Protocol

_MEMORY = 0.9967  # per 10/12-cycle value: a first-order filter of one minute


class Reference(Protocol):
    """The reference voltage of every phase."""

    sliding: bool

    def of(self, phase: int) -> float | None:
        """V; None: not known yet."""

    def take(self, phase: int, U: float, calm: bool) -> None:
        """The next Urms(1/2) [V] of a phase; not `calm`: an event goes on."""


class Declared:
    """A voltage that somebody has declared."""

    sliding = False

    def __init__(self, voltage: float) -> None:
        self._voltage = voltage

    def of(self, phase: int) -> float | None:  # noqa: ARG002 - the same for all
        """V."""
        return self._voltage

    def take(self, phase: int, U: float, calm: bool) -> None:
        """A declared voltage does not change."""


class Sliding:
    """Follows 10/12-cycle values with a time constant of a minute; values during an event do not count.

    The first 10/12-cycle value is the first reference, where no voltage is declared.
    """

    sliding = True

    def __init__(self, phases: int, f_nominal: float, declared: float | None = None) -> None:
        self._halves = 24 if f_nominal > 55 else 20
        self._reference: list[float | None] = [declared] * phases
        self._squares = [0.0] * phases
        self._count = [0] * phases
        self._calm = [True] * phases

    def of(self, phase: int) -> float | None:
        """V; None until the first 10/12-cycle value."""
        return self._reference[phase]

    def take(self, phase: int, U: float, calm: bool) -> None:
        """The next Urms(1/2) [V] of a phase: every second one belongs to the 10/12-cycle value."""
        self._count[phase] += 1
        self._calm[phase] &= calm
        if self._count[phase] % 2:
            self._squares[phase] += U * U
        if self._count[phase] < self._halves:
            return
        U10 = math.sqrt(2 * self._squares[phase] / self._halves)
        before = self._reference[phase]
        if before is None:
            self._reference[phase] = U10 if U10 > 0 else None
        elif self._calm[phase]:
            self._reference[phase] = _MEMORY * before + (1 - _MEMORY) * U10
        self._squares[phase], self._count[phase], self._calm[phase] = 0.0, 0, True
