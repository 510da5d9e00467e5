"""The mains stage: demanded power becomes i(t) at 20 kHz on a v(t) that wanders like a real one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from acqd.arrays import Floats
from acqd.lab.motion.controller import RATE
from acqd.metering import StreamFormat
from acqd.metering.block import CODE_MAX, CODE_MIN, Codes
from acqd.robot.description import Section
from acqd.sources import el3783

_PER_MS = round(el3783.RATE / RATE)
_TABLE = 8192
_KNOT_S = 1.0  # frequency and voltage are drawn once a second, linear in between
_SURGE_TAU_S = 0.02
_Order = Annotated[int, Field(ge=2, le=100)]
_Share = Annotated[float, Field(ge=-0.5, le=0.5)]


class MainsSettings(Section):
    """One phase of a building's supply and the input stage of the robot's cabinet."""

    frequency: Annotated[float, Field(ge=47, le=63)] = 50.0
    """Hz, long-term mean."""
    frequency_wander: Annotated[float, Field(ge=0, le=0.2)] = 0.015
    """Hz RMS, correlated over some 20 s."""
    voltage: Annotated[float, Field(ge=90, le=260)] = 230.0
    """V RMS, long-term mean."""
    voltage_wander: Annotated[float, Field(ge=0, le=10)] = 1.2
    """V RMS, correlated over some 2 min."""
    voltage_step: Annotated[float, Field(ge=0, le=10)] = 1.0
    """V: size of the steps by which loads and tap changers shift it, every ten minutes or so."""
    harmonics: dict[_Order, _Share] = Field(default={3: 0.006, 5: 0.021, 7: 0.012, 11: 0.005})
    """Of the voltage: order -> share."""
    shape: Literal["pfc", "rectifier"] = "pfc"
    """Sinusoidal current with some distortion, or the pulses of a rectifier with smoothing capacitor."""
    current_harmonics: dict[_Order, _Share] = Field(default={3: 0.06, 5: 0.035, 7: 0.02})
    """Of a pfc's current: order -> share."""
    filter_current: Annotated[float, Field(ge=0, le=2)] = 0.11
    """A RMS: leading, into the line filter's capacitors."""
    inrush: Annotated[float, Field(ge=0, le=100)] = 0.0
    """A peak at the session's first sample, where the cabinet is switched on."""
    noise_V: Annotated[float, Field(ge=0, le=5)] = 0.04
    """RMS per sample."""
    noise_A: Annotated[float, Field(ge=0, le=1)] = 0.0006
    """RMS per sample."""
    current_range: Literal[1, 5] = 5
    """Of the EL3783 [A]."""


@dataclass(frozen=True, slots=True)
class Metered:
    """What is wrong with the current sensor, at 1 kHz."""

    gain: Floats
    """[T]."""
    limit: Floats
    """[T] A; inf where the sensor is whole."""


class Mains:
    """Voltage first, then current once the power is known; state carries over from stretch to stretch."""

    def __init__(self, settings: MainsSettings, random: np.random.Generator) -> None:
        self.settings = settings
        self.form = StreamFormat(
            el3783.RATE,
            (el3783.U_V_PER_DIGIT, el3783.I_A_PER_DIGIT[settings.current_range]),
            60.0 if settings.frequency > 55 else 50.0,
        )
        self._random = random
        self._frequency = _Wander(settings.frequency, settings.frequency_wander, 20.0, 0.0, random)
        self._voltage = _Wander(settings.voltage, settings.voltage_wander, 120.0, settings.voltage_step, random)
        self._u_shape, self._i_shape = _shapes(settings, random)
        self._phase = float(random.uniform(0, 1))
        self._emitted_ms = 0
        self._carry: list[float] | None = None

    def voltage(self, first_ms: int, count: int) -> Floats:
        """[count] Vrms at `first_ms` milliseconds since the session's begin, and on."""
        return self._voltage.at(first_ms, count)

    def waveform(self, power: Floats, metered: Metered | None = None) -> Codes:
        """EL3783 codes [20 ms-samples, 2] for the power [T] (W, at 1 kHz) that follows on the last call's.

        The very last millisecond waits for the next call, because power is linear between its samples.
        """
        first = self._emitted_ms + (self._carry is not None)
        voltage = self.voltage(first, len(power))
        gain = metered.gain if metered else np.ones(len(power))
        limit = metered.limit if metered else np.full(len(power), np.inf)
        values = [power, voltage, gain, limit]
        if self._carry is not None:
            values = [np.concatenate([[before], now]) for before, now in zip(self._carry, values, strict=True)]
        self._carry = [float(value[-1]) for value in values]
        power, voltage, gain, limit = values
        count = len(power) - 1
        cycles = self._cycles(count)
        rms = _fine(voltage)
        u = rms * _lookup(self._u_shape, cycles)
        i = _fine(power) / rms * _lookup(self._i_shape, cycles)
        i += np.sqrt(2) * self.settings.filter_current * _lookup(_COSINE, cycles)
        if self._emitted_ms * 1e-3 < 10 * _SURGE_TAU_S and self.settings.inrush > 0:
            i += self._surge(cycles)
        self._emitted_ms += count
        i *= _fine(gain)
        if np.isfinite(limit).any():
            clipped = np.repeat(limit[:-1], _PER_MS)
            i = np.clip(i, -clipped, clipped)
        return self._quantised(u, i)

    def _cycles(self, count: int) -> Floats:
        """[samples] mains cycles since the session's begin, kept small."""
        frequency = self._frequency.at(self._emitted_ms, count + 1)
        steps = (frequency[1:] + frequency[:-1]) / (2 * RATE)
        grid = self._phase + np.concatenate([[0.0], np.cumsum(steps)])
        self._phase = float(grid[-1] % 1.0)
        return _fine(grid)

    def _surge(self, cycles: Floats) -> Floats:
        t = self._emitted_ms * 1e-3 + np.arange(len(cycles)) / el3783.RATE
        return np.asarray(self.settings.inrush * np.exp(-t / _SURGE_TAU_S) * np.sin(2 * np.pi * cycles))

    def _quantised(self, u: Floats, i: Floats) -> Codes:
        codes = np.empty((len(u), 2), dtype=np.int16)
        noise = (self.settings.noise_V, self.settings.noise_A)
        for channel, (values, rms, scale) in enumerate(zip((u, i), noise, self.form.scale, strict=True)):
            digits = values * (1 / scale)
            digits += self._random.standard_normal(len(u), dtype=np.float32) * np.float32(rms / scale)
            codes[:, channel] = np.clip(np.rint(digits), CODE_MIN, CODE_MAX)
        return codes


class _Wander:
    """A mean-reverting random walk, drawn once a second, with occasional steps of its mean."""

    def __init__(self, mean: float, rms: float, tau_s: float, step: float, random: np.random.Generator) -> None:
        self._mean, self._rms, self._step = mean, rms, step
        self._keep = float(np.exp(-_KNOT_S / tau_s))
        self._random = np.random.default_rng(random.integers(2**63))
        self._level = 0.0
        self._knots = np.array([mean + rms * self._random.standard_normal()])

    def at(self, first_ms: int, count: int) -> Floats:
        """[count] values from `first_ms` on, one a millisecond."""
        t = (first_ms + np.arange(count)) * 1e-3 / _KNOT_S
        self._extend(int(t[-1]) + 2)
        return np.asarray(np.interp(t, np.arange(len(self._knots)), self._knots))

    def _extend(self, count: int) -> None:
        more = []
        value = float(self._knots[-1])
        for _ in range(len(self._knots), count):
            if self._step and self._random.random() < _KNOT_S / 600:
                change = self._random.choice([-1, 1]) * self._step
                self._level = float(np.clip(self._level + change, -2 * self._step, 2 * self._step))
            centre = self._mean + self._level
            noise = self._rms * np.sqrt(1 - self._keep**2) * self._random.standard_normal()
            value = centre + self._keep * (value - centre) + noise
            more.append(value)
        if more:
            self._knots = np.concatenate([self._knots, more])


def _shapes(settings: MainsSettings, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Voltage per Vrms and current per (W / Vrms) over one cycle; the mean of their product is 1."""
    angle = 2 * np.pi * np.arange(_TABLE) / _TABLE
    u = np.sin(angle)
    for order, share in sorted(settings.harmonics.items()):
        u += share * np.sin(order * angle + random.uniform(0, 2 * np.pi))
    u /= np.sqrt(np.mean(u**2))
    if settings.shape == "pfc":
        i = np.sin(angle)
        for order, share in sorted(settings.current_harmonics.items()):
            i += share * np.sin(order * angle + random.uniform(0, 2 * np.pi))
    else:  # the capacitor is charged around the voltage's crest, a little before it
        centre, half_width = np.radians(84), np.radians(38)
        away = (angle - centre + np.pi / 2) % np.pi - np.pi / 2
        i = np.where(np.abs(away) < half_width, np.cos(away / half_width * np.pi / 2), 0.0) * np.sign(np.sin(angle))
    return _closed(u), _closed(i / np.mean(u * i))


def _closed(table: Floats) -> Floats:
    """With its first value again at the end, for interpolation."""
    return np.concatenate([table, table[:1]])


_COSINE = _closed(np.cos(2 * np.pi * np.arange(_TABLE) / _TABLE))


def _lookup(table: Floats, cycles: Floats) -> Floats:
    """`table` over one cycle at `cycles`, linear in between."""
    position = cycles * _TABLE
    before: NDArray[np.int64] = position.astype(np.int64)
    share = position - before
    before &= _TABLE - 1
    low = table[before]
    return np.asarray(low + share * (table[before + 1] - low))


def _fine(grid: Floats) -> Floats:
    """[T] values a millisecond apart -> [(T - 1) * 20] values 50 us apart, linear."""
    share = np.arange(_PER_MS) / _PER_MS
    return np.asarray((grid[:-1, None] + np.diff(grid)[:, None] * share).ravel())
