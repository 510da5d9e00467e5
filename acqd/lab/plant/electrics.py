"""From motor torque to mains power: copper, inverters, DC link with chopper, supply."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.lab.plant.parameters import ControllerLoad, DcLink, DriveLosses, Supply
from acqd.motion.controller import RATE
from acqd.robot.description import Drive

_DT = 1.0 / RATE


class Motors:
    """Permanent-magnet motors behind ideal gears."""

    def __init__(self, drives: list[Drive], losses: DriveLosses) -> None:
        self._constant = np.array([drive.torque_constant_Nm_A * drive.gear_ratio for drive in drives])
        self._resistance = np.array([drive.resistance_Ohm for drive in drives])
        self._losses = losses

    def current(self, tau: Floats) -> Floats:
        """[T, axes] A for torques [T, axes] (Nm) at the output of the gears."""
        return np.asarray(tau / self._constant)

    def copper_loss(self, current: Floats) -> Floats:
        """Power I^2 R in the windings, [T, axes] W."""
        return np.asarray(self._resistance * current * current)

    def inverter_loss(self, current: Floats, power: Floats, enabled: Floats) -> Floats:
        """[T] W: constant while `enabled` [T], conduction proportional to current, switching proportional to power."""
        per_axis = self._losses.per_ampere_W * np.abs(current) + self._losses.share * np.abs(power)
        return np.asarray(per_axis.sum(axis=1) + self._losses.enabled_W * power.shape[1] * enabled)


class DcStorage:
    """The capacitor of the DC link stores regenerated power; when it is full, the brake chopper dissipates it."""

    def __init__(self, link: DcLink) -> None:
        self._limit = link.capacitor_J
        self.energy = 0.0
        """J above the set point of the supply."""

    def run(self, net: Floats) -> tuple[Floats, Floats, Floats]:
        """Power drawn from the supply, dissipated and stored, each [T] W, for the net power [T] W of all DC loads.

        Negative net power is regenerated.
        """
        dissipated = np.zeros_like(net)
        stored = np.zeros_like(net)
        for k in self._active_samples(net):
            change = -net[k] * _DT  # flow into the capacitor while the supply delivers nothing
            new = min(max(self.energy + change, 0.0), self._limit)
            if self.energy + change > self._limit:
                dissipated[k] = (self.energy + change - self._limit) / _DT
            stored[k] = (new - self.energy) / _DT
            self.energy = new
        return net + stored + dissipated, dissipated, stored

    def _active_samples(self, net: Floats) -> list[int]:
        """Samples with regenerated power or a charged capacitor; only these few need the loop in `run`."""
        if self.energy == 0.0 and net.min() >= 0:
            return []
        active: list[int] = []
        energy = self.energy
        for k in np.flatnonzero(net < 0) if energy == 0.0 else range(len(net)):
            if active and k <= active[-1]:
                continue
            at = int(k)
            while at < len(net) and (net[at] < 0 or energy > 0):
                energy = min(max(energy - net[at] * _DT, 0.0), self._limit)
                active.append(at)
                at += 1
        return active


class Standby:
    """Standby power of the cabinet: a constant with the fluctuation of its computer and fans."""

    def __init__(self, load: ControllerLoad, random: np.random.Generator) -> None:
        self._power = load.power_W
        self._parts = [
            _Fluctuation(load.fast_fluctuation_W, 0.15, random),
            _Fluctuation(load.slow_fluctuation_W, 30.0, random),
        ]

    def run(self, samples: int) -> Floats:
        """Standby power, [samples] W, continuing the last call."""
        return self._power + sum((part.run(samples) for part in self._parts), np.zeros(samples))


class _Fluctuation:
    """First-order autoregressive noise of a given RMS and correlation time."""

    def __init__(self, rms: float, tau_s: float, random: np.random.Generator) -> None:
        self._keep = float(np.exp(-_DT / tau_s))
        self._drive = rms * np.sqrt(1 - self._keep**2)
        self._random = np.random.default_rng(random.integers(2**63))  # the noise must not depend on the call lengths
        self._value = rms * float(self._random.standard_normal())

    def run(self, samples: int) -> Floats:
        noise = self._drive * self._random.standard_normal(samples)
        values, _ = lfilter([1.0], [1.0, -self._keep], noise, zi=[self._keep * self._value])
        self._value = float(values[-1])
        return np.asarray(values)


class PowerSupply:
    """Losses that grow with the load, and a first-order lag between load and mains."""

    def __init__(self, supply: Supply) -> None:
        self._supply = supply
        c = 2 * supply.lag_s / _DT
        self._b, self._a = np.array([1.0, 1.0]) / (1 + c), np.array([1.0, (1 - c) / (1 + c)])
        self._state: Floats | None = None
        self._last = 0.0

    def loss(self, output: Floats) -> Floats:
        """[T] W of loss at `output` [T] (W)."""
        s = self._supply
        return np.asarray(s.fixed_W + s.linear * output + s.quadratic_per_W * output * output)

    def lagged(self, demand: Floats) -> Floats:
        """[T] W drawn from the mains for `demand` [T] (W): first-order lag, discretised by the trapezoidal rule."""
        if self._state is None:  # steady state before the first sample
            self._state = np.array([demand[0] * (1 - self._b[0])])
        power, self._state = lfilter(self._b, self._a, demand, zi=self._state)
        self._last = float(power[-1])
        return np.asarray(power)

    @property
    def stored(self) -> float:
        """Energy (J) in the bulk capacitor, relative to zero power; its discharge causes the lag."""
        return -self._supply.lag_s * self._last
