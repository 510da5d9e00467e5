"""Voltage events of IEC 61000-4-30: what one is, and the thresholds that make one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Kind = Literal["dip", "swell", "interruption", "rvc", "transient"]
"""`rvc`: rapid voltage change."""


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Shares of the reference voltage; the defaults are from EN 50160 and IEC 61000-4-30."""

    dip: float = 0.90
    swell: float = 1.10
    interruption: float = 0.05
    hysteresis: float = 0.02
    """How far beyond its threshold the voltage must return before an event ends."""
    rvc: float = 0.05
    """Distance from the mean of a second that ends the steady state; 0: no rapid voltage changes."""
    rvc_hysteresis: float = 0.5
    """Share of `rvc` by which the distance must be smaller before the voltage is steady again."""

    transient: float = 0.0
    """Distance of a sample from the waveform of the cycles before, as a share of the reference's peak; 0: none."""

    def __post_init__(self) -> None:
        if self.transient and not 0.05 <= self.transient <= 3:
            raise ValueError("transients: expected a threshold from 5 to 300 %, or 0 for none")
        if not 0 < self.interruption < self.dip < 1 < self.swell < 3:
            raise ValueError("expected 0 < interruption < dip < 100 % < swell < 300 %")
        limits = (self.dip - self.interruption, 1 - self.dip, self.swell - 1)
        if not 0 <= self.hysteresis < min(limits):
            raise ValueError(f"hysteresis: expected from 0 to less than {100 * min(limits):g} % with these thresholds")
        if not 0 <= self.rvc < 0.5 or not 0 <= self.rvc_hysteresis < 1:
            raise ValueError("rapid voltage changes: expected a threshold from 0 to less than 50 %")


@dataclass(frozen=True, slots=True)
class Event:
    """One event; the same event is reported when it begins (without `end`) and when it has ended."""

    number: int
    """Of the stream, from 0; both reports have it."""
    kind: Kind
    begin: float
    """Sample number (with fraction) at which the voltage changed that crossed the threshold first."""
    utc_ns: int
    """The same as UTC [ns]."""
    phases: tuple[int, ...]
    """Phases (from 0) that crossed the threshold."""
    extreme: float
    """V: lowest Urms(1/2) of a dip or interruption (residual voltage), highest of a swell, largest change of an rvc,
    largest distance of a transient from the undisturbed waveform."""
    reference: float
    """V: what 100 % is, in the phase of `extreme`."""
    end: float | None = None
    """Sample number of its end; None: it goes on."""
    duration: float | None = None
    """s."""
    steady_change: float | None = None
    """V: of an rvc, the difference of the steady voltages before and after it."""
    flags: frozenset[str] = field(default_factory=frozenset)
    """Flags of the samples; `impulsive` or `oscillatory` of a transient; `start` (it was there when the stream began),
    `gap` (samples are missing before its start or after its end: it may be longer), `unfinished` (the stream ends in
    it)."""
