"""What every model does: power of a whole recording, or row by row as angles arrive."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.models.features import padded


class Predictor(ABC):
    """Power from joint angles at even steps; plain numpy, so that a measurement PC needs nothing else."""

    axes: int
    step_s: float
    radius: int
    """Rows to either side that a row's prediction needs: a live prediction is late by so many steps."""
    signals: tuple[str, ...] = ()
    """Logged states that are used besides the angles, in this order."""

    def sequence(self, q: Floats, signals: Floats | None = None, start_s: float | None = None) -> Floats:  # noqa: ARG002
        """[T] W for angles [T, axes] (rad) and signals [T, len(self.signals)]; `start_s`: UTC of the first (Unix s)."""
        return self.run(padded(q, self.radius), self.known(signals, len(q)))

    def known(self, signals: Floats | None, rows: int) -> Floats:
        """Signals [rows, k], or what they usually were in training."""
        if signals is not None:
            return signals
        return np.tile(self.usual_signals(), (rows, 1))

    def usual_signals(self) -> Floats:
        """[k] values of signals that nobody logged."""
        return np.zeros(len(self.signals))

    @abstractmethod
    def run(self, q: Floats, signals: Floats) -> Floats:
        """[T] W for angles [T + 2 radius, axes] and signals [T, k]."""

    @abstractmethod
    def start(self) -> Any:
        """The state before the first row."""

    @abstractmethod
    def step(self, state: Any, window: Floats, signals: Floats) -> float:
        """W for the middle of angles [2 radius + 1, axes]; moves `state` on."""


class Stream:
    """Predictions row by row, equal to those of the whole sequence; each comes `radius` rows late."""

    def __init__(self, model: Predictor) -> None:
        self._model = model
        self._state = model.start()
        self._rows: deque[Floats] = deque(maxlen=2 * model.radius + 1)
        self._signals: deque[Floats] = deque(maxlen=model.radius + 1)

    def step(self, q: Floats, signals: Floats | None = None) -> float | None:
        """Take angles [axes] and signals [k]; the power `radius` rows ago, None while that lies before the first."""
        q = np.array(q)  # the caller may fill the same array again
        self._signals.append(self._model.usual_signals() if signals is None else np.array(signals))
        if not self._rows:
            self._rows.extend([q] * self._model.radius)
        return self._push(q)

    def finish(self) -> list[float]:
        """Predictions of the last `radius` rows, with the last angles held."""
        late: list[float] = []
        for _ in range(self._model.radius if self._rows else 0):
            self._signals.append(self._signals[-1])
            value = self._push(self._rows[-1])
            if value is not None:
                late.append(value)
        return late

    def _push(self, q: Floats) -> float | None:
        self._rows.append(q)
        if len(self._rows) < 2 * self._model.radius + 1:
            return None
        return self._model.step(self._state, np.array(self._rows), self._signals[0])
