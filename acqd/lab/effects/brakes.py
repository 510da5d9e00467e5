"""Holding brakes: the power peak when they open, and the power of their coils while they are open."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.lab.plant.situation import Effect, Situation
from acqd.motion.controller import RATE


class BrakeRelease(Effect):
    """Pull-in current of the brakes and inrush of the motors: the initial peak in thesis Figures 6.2 and 9.4."""

    id = "brake_release"
    summary = "power peak when the brakes open: a surge with time constant tau_s, plus pull_W for pull_s"
    strength = ("peak_W", "W")
    defaults: ClassVar = {"peak_W": 220.0, "tau_s": 0.12, "pull_W": 60.0, "pull_s": 0.2}
    limits: ClassVar = {"tau_s": (0.001, 10), "pull_s": (0, 60)}

    def begin(self) -> None:
        """No surge is decaying, and the brakes are closed."""
        self._surge = 0.0
        self._since_s = np.inf  # since the last opening
        self._was_open = False

    def dc_load(self, situation: Situation) -> Floats:
        """Surge and pull-in from each opening on, [T] W."""
        opened = situation.motion.brake_open
        edges = opened & ~np.concatenate([[self._was_open], opened[:-1]])
        edges &= self.gate(situation) > 0
        self._was_open = bool(opened[-1])
        keep = np.exp(-1 / (RATE * self["tau_s"]))
        surge, _ = lfilter([1.0], [1, -keep], edges.astype(float), zi=[keep * self._surge])
        self._surge = float(surge[-1])
        since_s = seconds_since(edges, self._since_s)
        self._since_s = float(since_s[-1])
        return np.asarray(self["peak_W"] * surge + self["pull_W"] * (since_s < self["pull_s"]))


class BrakeHolding(Effect):
    """Holding current that keeps the brakes open."""

    id = "brake_holding"
    summary = "power of the brake coils while they are open"
    strength = ("power_W", "W")
    defaults: ClassVar = {"power_W": 10.0}

    def dc_load(self, situation: Situation) -> Floats:
        """Coil power while the brakes are open, [T] W."""
        return self["power_W"] * situation.motion.brake_open * self.gate(situation)


def seconds_since(events: NDArray[np.bool_], before: float) -> Floats:
    """Time since the last of `events` [T], [T] s; `before` is its value at the preceding sample."""
    index = np.arange(len(events))
    last = np.maximum.accumulate(np.where(events, index, -1))
    return np.where(last >= 0, (index - last) / RATE, before + (index + 1) / RATE)
