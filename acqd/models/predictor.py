"""Interface of every model: power of a whole segment, or row by row as angles arrive."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from acqd.arrays import Floats
from acqd.models.features import continued, lead_in, padded

Beyond: TypeAlias = Callable[[Floats, int], Floats]
"""Angles [T, axes] and a number of rows to the angles with so many rows before and after."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """What a model is asked about: rows of a recording, with rows before and after them that are only needed."""

    q: Floats
    """[before + T + after, axes] rad."""
    signals: Floats | None
    """[before + T + after, k]; None: the usual."""
    start_s: float | None
    """Unix time of the first row, s."""
    before: int = 0

    def led_in(self, step_s: float) -> Recorded:
        """With the rows before a recording that begins in motion (see `lead_in`)."""
        more = lead_in(self.q)
        signals = None if self.signals is None else np.pad(self.signals, ((len(more), 0), (0, 0)), mode="edge")
        start_s = None if self.start_s is None else self.start_s - len(more) * step_s
        return Recorded(np.concatenate([more, self.q]), signals, start_s, self.before + len(more))


class Predictor(ABC):
    """Predicts power from joint angles at a constant step. Plain numpy, so that a measurement PC needs no torch."""

    axes: int
    step_s: float
    radius: int
    """Rows before and after a row that its prediction needs; a live prediction is late by as many steps."""
    signals: tuple[str, ...] = ()
    """Logged signals that are used in addition to the angles, in this order."""

    def sequence(
        self,
        q: Floats,
        signals: Floats | None = None,
        start_s: float | None = None,  # noqa: ARG002
        beyond: Beyond = padded,
    ) -> Floats:
        """Power [T] W of angles [T, axes] rad and signals [T, k], None: the usual; `start_s`: Unix time of row 0.

        `beyond` adds the rows before and after. By default the arm rests there, as for a stream and an exported model.
        """
        return self.run(beyond(q, self.radius), self.known(signals, len(q)))

    def recording(self, q: Floats, signals: Floats | None = None, start_s: float | None = None) -> Floats:
        """As `sequence`, of a recording that may begin and end in motion."""
        begun = Recorded(q, signals, start_s).led_in(self.step_s)
        return self.sequence(begun.q, begun.signals, begun.start_s, continued)[begun.before :]

    def known(self, signals: Floats | None, rows: int) -> Floats:
        """Signals [rows, k]; None is replaced by the usual values."""
        if signals is not None:
            return signals
        return np.tile(self.usual_signals(), (rows, 1))

    def usual_signals(self) -> Floats:
        """Values [k] that stand for signals that were not logged."""
        return np.zeros(len(self.signals))

    @abstractmethod
    def run(self, q: Floats, signals: Floats) -> Floats:
        """Power [T] W of angles [T + 2 radius, axes] rad and signals [T, k]."""

    @abstractmethod
    def start(self) -> Any:
        """State before the first row."""

    @abstractmethod
    def step(self, state: Any, window: Floats, signals: Floats) -> float:
        """Power in W of the middle row of angles [2 radius + 1, axes], with signals [k]; updates `state`."""


class Stream:
    """Predicts row by row, `radius` rows late. The result equals `Predictor.sequence` of all rows."""

    def __init__(self, model: Predictor) -> None:
        self._model = model
        self.state = model.start()
        self._rows: deque[Floats] = deque(maxlen=2 * model.radius + 1)
        self._signals: deque[Floats] = deque(maxlen=model.radius + 1)

    def step(self, q: Floats, signals: Floats | None = None) -> float | None:
        """Add a row: angles [axes] rad, signals [k]. Returns the power `radius` rows ago, None before the first row."""
        q = np.array(q)  # a copy: the caller may reuse the array
        self._signals.append(self._model.usual_signals() if signals is None else np.array(signals))
        if not self._rows:
            self._rows.extend([q] * self._model.radius)
        return self._push(q)

    def finish(self) -> list[float]:
        """Power of the last `radius` rows, with the last angles held."""
        predicted: list[float] = []
        for _ in range(self._model.radius if self._rows else 0):
            self._signals.append(self._signals[-1])
            value = self._push(self._rows[-1])
            if value is not None:
                predicted.append(value)
        return predicted

    def _push(self, q: Floats) -> float | None:
        self._rows.append(q)
        if len(self._rows) < 2 * self._model.radius + 1:
            return None
        return self._model.step(self.state, np.array(self._rows), self._signals[0])
