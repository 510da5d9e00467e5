"""Holding brakes: the peak when they open, and what they take while they are open."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.lab.motion.controller import RATE
from acqd.lab.plant.situation import Effect, Situation


class BrakeRelease(Effect):
    """Pull-in current of the brakes and inrush of the motors, the initial peak of thesis Figures 6.2 and 9.4."""

    id = "brake_release"
    summary = "peak when the brakes open: a surge that decays within tau_s, on top of a pull-in of pull_W for pull_s"
    strength = ("peak_W", "W")
    defaults: ClassVar = {"peak_W": 220.0, "tau_s": 0.12, "pull_W": 60.0, "pull_s": 0.2}
    limits: ClassVar = {"tau_s": (0.001, 10), "pull_s": (0, 60)}

    def begin(self) -> None:
        """Fresh state."""
        self._surge = 0.0
        self._since = np.inf
        self._was_open = False

    def dc_load(self, situation: Situation) -> Floats:
        """W, from the moment of each opening."""
        opened = situation.motion.brake_open
        edges = opened & ~np.concatenate([[self._was_open], opened[:-1]])
        edges &= self.gate(situation) > 0
        self._was_open = bool(opened[-1])
        keep = np.exp(-1 / (RATE * self["tau_s"]))
        surge, _ = lfilter([1.0], [1, -keep], edges.astype(float), zi=[keep * self._surge])
        self._surge = float(surge[-1])
        since = seconds_since(edges, self._since)
        self._since = float(since[-1])
        return np.asarray(self["peak_W"] * surge + self["pull_W"] * (since < self["pull_s"]))


class BrakeHolding(Effect):
    """Current that keeps the brakes open."""

    id = "brake_holding"
    summary = "power of the brake coils while they are open"
    strength = ("power_W", "W")
    defaults: ClassVar = {"power_W": 10.0}

    def dc_load(self, situation: Situation) -> Floats:
        """W."""
        return self["power_W"] * situation.motion.brake_open * self.gate(situation)


def seconds_since(events: NDArray[np.bool_], before: float) -> Floats:
    """[T] s since the last of `events` [T]; `before` is what it was at the sample before."""
    at = np.arange(len(events))
    last = np.maximum.accumulate(np.where(events, at, -1))
    return np.where(last >= 0, (at - last) / RATE, before + (at + 1) / RATE)
