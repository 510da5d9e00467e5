"""The mains: voltage with varying frequency and amplitude, and the current that draws the demanded power from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from acqd.arrays import Floats
from acqd.lab.instruments.wave_tables import (
    COSINE,
    PER_MS,
    lookup,
    pfc_current_table,
    rectifier_current_table,
    resample,
    voltage_table,
)
from acqd.metering import StreamFormat
from acqd.metering.block import CODE_MAX, CODE_MIN, Codes
from acqd.motion.controller import RATE
from acqd.robot.description import Section
from acqd.section import KEY
from acqd.sources import el3783

_KNOT_S = 1.0  # frequency and voltage are drawn once per second and interpolated linearly
_STEP_EVERY_S = 600.0  # mean time between steps of the voltage
_SURGE_TAU_S = 0.02
_Order = Annotated[int, KEY, Field(ge=2, le=100)]
_Share = Annotated[float, Field(ge=-0.5, le=0.5)]


class MainsSettings(Section):
    """One phase of a building's mains and the input stage of the robot's cabinet."""

    frequency: Annotated[float, Field(ge=47, le=63)] = 50.0
    """Hz, long-term mean."""
    frequency_wander: Annotated[float, Field(ge=0, le=0.2)] = 0.015
    """Hz RMS, correlated over 20 s."""
    voltage: Annotated[float, Field(ge=90, le=260)] = 230.0
    """V RMS, long-term mean."""
    voltage_wander: Annotated[float, Field(ge=0, le=10)] = 1.2
    """V RMS, correlated over 2 min."""
    voltage_step: Annotated[float, Field(ge=0, le=10)] = 1.0
    """V: steps of the mean voltage by other loads and tap changers, ten minutes apart on average."""
    harmonics: dict[_Order, _Share] = Field(default={3: 0.006, 5: 0.021, 7: 0.012, 11: 0.005})
    """Harmonics of the voltage: order -> share."""
    shape: Literal["pfc", "rectifier"] = "pfc"
    """Current of a power factor correction (sine with harmonics), or pulses of a rectifier with smoothing capacitor."""
    current_harmonics: dict[_Order, _Share] = Field(default={3: 0.06, 5: 0.035, 7: 0.02})
    """Harmonics of the current of shape `pfc`: order -> share."""
    filter_current: Annotated[float, Field(ge=0, le=2)] = 0.11
    """A RMS: leading current of the line filter's capacitors."""
    inrush: Annotated[float, Field(ge=0, le=100)] = 0.0
    """A peak at the first sample of the session, when the cabinet is switched on."""
    noise_V: Annotated[float, Field(ge=0, le=5)] = 0.04
    """RMS per sample."""
    noise_A: Annotated[float, Field(ge=0, le=1)] = 0.0006
    """RMS per sample."""
    current_range: Literal[1, 5] = 5
    """A, measuring range of the EL3783."""


@dataclass(frozen=True, slots=True)
class Metered:
    """Fault of the current sensor, at 1 kHz."""

    gain: Floats
    """[T]."""
    limit: Floats
    """[T] A at which the sensor saturates; inf without saturation."""


class Mains:
    """Voltage and current waveforms of one session. State carries over from call to call."""

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
        self._u_table = voltage_table(settings.harmonics, random)
        self._i_table = (
            pfc_current_table(settings.current_harmonics, random, self._u_table)
            if settings.shape == "pfc"
            else rectifier_current_table(self._u_table)
        )
        self._phase = float(random.uniform(0, 1))
        self._emitted_ms = 0
        self._carry: list[float] | None = None

    def voltage(self, first_ms: int, count: int) -> Floats:
        """[count] Vrms, 1 ms apart, from `first_ms` milliseconds after the start of the session."""
        return self._voltage.at(first_ms, count)

    def waveform(self, power: Floats, sensor: Metered | None = None) -> Codes:
        """EL3783 codes [20 T, 2] for power [T] (W, at 1 kHz) that continues the power of the last call.

        The last millisecond waits for the next call, because power is interpolated between its samples.
        """
        first = self._emitted_ms + (self._carry is not None)
        voltage = self.voltage(first, len(power))
        gain = sensor.gain if sensor else np.ones(len(power))
        limit = sensor.limit if sensor else np.full(len(power), np.inf)
        values = [power, voltage, gain, limit]
        if self._carry is not None:
            values = [np.concatenate([[last], new]) for last, new in zip(self._carry, values, strict=True)]
        self._carry = [float(value[-1]) for value in values]
        power, voltage, gain, limit = values
        count = len(power) - 1
        cycles = self._cycles(count)
        rms = resample(voltage)
        u = rms * lookup(self._u_table, cycles)
        i = resample(power) / rms * lookup(self._i_table, cycles)
        i += np.sqrt(2) * self.settings.filter_current * lookup(COSINE, cycles)
        if self._emitted_ms * 1e-3 < 10 * _SURGE_TAU_S and self.settings.inrush > 0:
            i += self._surge(cycles)
        self._emitted_ms += count
        i *= resample(gain)
        if np.isfinite(limit).any():
            limits = np.repeat(limit[:-1], PER_MS)
            i = np.clip(i, -limits, limits)
        return self._quantised(u, i)

    def _cycles(self, count: int) -> Floats:
        """[samples] phase in mains cycles; whole cycles are dropped between calls to keep it small."""
        frequency = self._frequency.at(self._emitted_ms, count + 1)
        steps = (frequency[1:] + frequency[:-1]) / (2 * RATE)
        grid = self._phase + np.concatenate([[0.0], np.cumsum(steps)])
        self._phase = float(grid[-1] % 1.0)
        return resample(grid)

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
    """A first-order autoregressive process (correlation time `tau_s`) with occasional steps of its mean."""

    def __init__(self, mean: float, rms: float, tau_s: float, step: float, random: np.random.Generator) -> None:
        self._mean, self._rms, self._step = mean, rms, step
        self._keep = float(np.exp(-_KNOT_S / tau_s))
        self._random = np.random.default_rng(random.integers(2**63))
        self._level = 0.0
        self._knots = np.array([mean + rms * self._random.standard_normal()])

    def at(self, first_ms: int, count: int) -> Floats:
        """[count] values 1 ms apart, from `first_ms` on."""
        t = (first_ms + np.arange(count)) * 1e-3 / _KNOT_S
        self._extend(int(t[-1]) + 2)
        return np.asarray(np.interp(t, np.arange(len(self._knots)), self._knots))

    def _extend(self, count: int) -> None:
        added = []
        value = float(self._knots[-1])
        for _ in range(len(self._knots), count):
            if self._step and self._random.random() < _KNOT_S / _STEP_EVERY_S:
                change = self._random.choice([-1, 1]) * self._step
                self._level = float(np.clip(self._level + change, -2 * self._step, 2 * self._step))
            centre = self._mean + self._level
            noise = self._rms * np.sqrt(1 - self._keep**2) * self._random.standard_normal()
            value = centre + self._keep * (value - centre) + noise
            added.append(value)
        if added:
            self._knots = np.concatenate([self._knots, added])
