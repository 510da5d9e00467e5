"""All quantities of a 10/12-cycle interval, from its samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.metering.power import effective
from acqd.metering.quality.apparent import arithmetic_apparent, effective_apparent
from acqd.metering.quality.bands import bands, low_lines
from acqd.metering.quality.components import Phasors, rotation, symmetrical, unbalance_of
from acqd.metering.quality.cycles import MIN_PURITY
from acqd.metering.quality.event_flags import INTERRUPTION, event_flags
from acqd.metering.quality.harmonic_power import harmonic_powers
from acqd.metering.quality.integrals import HalfCycleIntegrals, half_cycle_integrals
from acqd.metering.quality.intervals import Interval
from acqd.metering.quality.response import IDEAL, Responses, without
from acqd.metering.quality.spectrum import (
    Lines,
    groups,
    interharmonic_groups,
    known_orders,
    line_squares,
    signalling,
    spectrum,
)
from acqd.metering.quality.values import QualityValues


@dataclass(frozen=True, slots=True)
class Options:
    """What is measured where somebody wants it."""

    interharmonic_groups: bool = False
    """All lines between harmonics, besides the centred subgroups."""
    signalling_Hz: float | None = None
    """Carrier of mains signalling."""
    signalling_threshold: float | None = None
    """Share of the declared voltage above which the signal is recorded; None: it is only measured."""
    signalling_s: float = 120.0
    """How long a recording lasts."""
    harmonic_powers: bool = False
    """Angles of voltage and current and the active power of each harmonic."""
    lines: bool = False
    """Each line of 5 Hz up to 100 Hz."""
    bands: bool = False
    """Bands of 200 Hz and of 1 kHz from 2 to 9 kHz."""
    responses: Responses = IDEAL
    """Of the transformers; taken out of all that comes from a spectrum."""


DEFAULT = Options()
OFF_NOMINAL = "off_nominal"
"""Flag: the voltage has no fundamental near the nominal frequency, so nothing that a spectrum tells is known."""
OF_ANY_F = frozenset(
    {"Vrms", "Irms", "P", "S", "V_crest", "I_crest", "V_dc", "I_dc", "V_12", "V_23", "V_31", "I_n_derived", "Se"}
)
"""Quantities that hold whatever f is, but for the cycles that the interval cuts."""
_OTHER_SYSTEM = 200.0
"""% of the declared voltage: no mains stays above it for an interval."""


@np.errstate(invalid="ignore", over="ignore")
def measure(interval: Interval, declared: float, options: Options = DEFAULT) -> QualityValues:
    """Quantities of `interval`; `declared` voltage [V], for the flags of events."""
    integrals = _integrals(interval)
    lines = spectrum(interval.x, interval.start, interval.length, interval.cycles)
    lines = without(options.responses, lines, interval.f / interval.cycles)
    phase = _waveform_values(integrals) | _fundamental(lines, interval.cycles) | _groups(lines, interval, options)
    if options.signalling_Hz is not None:
        phase["V_ms"] = signalling(lines[0::2], interval.f / interval.cycles, options.signalling_Hz)
    phase |= deviations(phase["Vrms"], declared)
    system = _system(integrals, phase, lines[:, interval.cycles]) if len(integrals.products) > 1 else {}
    known, flags = interval.fit.credible, interval.flags
    if not known and _elsewhere(phase, declared):
        flags |= {OFF_NOMINAL}
        phase = {name: value if name in OF_ANY_F else np.full_like(value, np.nan) for name, value in phase.items()}
        system = {name: value if name in OF_ANY_F else np.nan for name, value in system.items()}
    return QualityValues(
        kind="10/12",
        utc_ns=interval.utc_ns,
        duration=interval.duration,
        intervals=1,
        f=interval.f if known else np.nan,
        rocof=interval.fit.rocof if known and not interval.fit.jump else np.nan,
        phase=phase,
        system=system,
        flags=flags | event_flags(integrals.one_cycle_rms(), declared),
        phase_flags=_overrange(integrals, interval.stops),
    )


def deviations(V: Floats, declared: float) -> dict[str, Floats]:
    """Underdeviation and overdeviation [%] of RMS values from the `declared` voltage, both [V] (IEC 61000-4-30, 5.12).

    What lies above counts as the declared voltage in the one, what lies below in the other: neither is negative. NaN
    above twice the declared voltage, which then is that of another system.
    """
    share = 100 * V / declared
    share[share > _OTHER_SYSTEM] = np.nan
    return {"V_under": np.maximum(100 - share, 0.0), "V_over": np.maximum(share - 100, 0.0)}


def _elsewhere(phase: dict[str, Floats], declared: float) -> bool:
    """Whether there is a voltage whose fundamental is not at the f of the interval: by the whole of its phases."""
    ac = np.sum(np.square(phase["Vrms"]) - np.square(phase["V_dc"]))
    live = (phase["Vrms"] > INTERRUPTION * declared).any()
    return bool(live and np.sum(np.square(phase["V1"])) < MIN_PURITY * ac)


def _overrange(integrals: HalfCycleIntegrals, stops: Floats) -> list[frozenset[str]]:
    """Flags of the phases: whether a sample was at an end stop of the converter."""
    stopped = ((integrals.lowest <= stops[0]) | (integrals.highest >= stops[1])).tolist()
    return [frozenset({"overrange"} if any(pair) else ()) for pair in zip(stopped[0::2], stopped[1::2], strict=True)]


def waveform_values(interval: Interval) -> dict[str, Floats]:
    """What needs no spectrum: RMS and power of all that the sampling rate lets through, crest factors."""
    return _waveform_values(_integrals(interval))


def _integrals(interval: Interval) -> HalfCycleIntegrals:
    halves = 2 * interval.cycles
    return half_cycle_integrals(interval.x, interval.start, interval.length / halves, halves)


def _waveform_values(integrals: HalfCycleIntegrals) -> dict[str, Floats]:
    rms = integrals.rms(integrals.squares)
    with np.errstate(invalid="ignore", divide="ignore"):
        crest = integrals.peaks / rms
    crest[~np.isfinite(crest)] = np.nan
    V, I = rms[0::2], rms[1::2]  # noqa: E741
    P = integrals.mean(integrals.products)
    return {"Vrms": V, "Irms": I, "P": P, "S": V * I, "V_crest": crest[0::2], "I_crest": crest[1::2]}


def _fundamental(lines: Lines, cycles: int) -> dict[str, Floats]:
    """Magnitudes and angles of the fundamental, its powers, DC.

    S1 = U1 I1 conj = P1 + j Q1 (IEEE 1459-2010, section 3.1.2): Q1 > 0 where the current lags (inductive, import).
    Angles [deg] refer to U1 of L1.
    """
    both = lines[:, cycles]
    U1, I1, sizes = both[0::2], both[1::2], np.abs(both)
    power = U1 * I1.conj()
    reference = U1[0] / sizes[0] if sizes[0] > 0 else 1.0
    angles = np.where(sizes > 0, np.degrees(np.angle(both / reference)), np.nan)
    return {
        "V1": sizes[0::2], "I1": sizes[1::2], "V1_angle": angles[0::2], "I1_angle": angles[1::2],
        "P1": power.real, "Q1": power.imag, "S1": np.abs(power),
        "V_dc": lines[0::2, 0].real, "I_dc": lines[1::2, 0].real,
    }  # fmt: skip


def _groups(lines: Lines, interval: Interval, options: Options) -> dict[str, Floats]:
    known = known_orders(interval.rate, interval.f)
    harmonics, between, distortion = groups(lines, interval.cycles, known)
    lists = {"thds": distortion, "h": harmonics, "ih": between}
    if options.interharmonic_groups:
        lists["ig"] = interharmonic_groups(line_squares(lines, interval.cycles))
        lists["ig"][:, known:] = np.nan
    if options.lines:
        lists["lines"] = low_lines(lines)
    if options.bands:
        lists["bands"], lists["bands_1k"] = bands(
            interval.x, interval.start, interval.length, interval.cycles, interval.f, options.responses
        )
    if options.harmonic_powers:
        lists["h_angle"], power = harmonic_powers(lines, interval.cycles, known)
    phase = {
        f"{name}_{kind}": values[first::2] for first, name in enumerate(("V", "I")) for kind, values in lists.items()
    }
    return phase | {"P_h": power} if options.harmonic_powers else phase


def _system(integrals: HalfCycleIntegrals, phase: dict[str, Floats], fundamentals: Phasors) -> dict[str, float]:
    """Quantities of two or three phases; `fundamentals` [channels]."""
    V, I = phase["Vrms"].tolist(), phase["Irms"].tolist()  # noqa: E741
    line = integrals.rms(integrals.lines).tolist()
    system = {
        "Vrms": effective(V), "Irms": effective(I), "P": sum(phase["P"].tolist()), "S": arithmetic_apparent(V, I),
        "P1": sum(phase["P1"].tolist()), "Q1": sum(phase["Q1"].tolist()), "S1": sum(phase["S1"].tolist()),
        "V_12": line[0],
    }  # fmt: skip
    return system | _three(integrals, phase, line, fundamentals) if len(line) == 3 else system


def _three(
    integrals: HalfCycleIntegrals, phase: dict[str, Floats], line: list[float], fundamentals: Phasors
) -> dict[str, float]:
    neutral = float(integrals.rms(integrals.neutral))
    U, I = np.abs(symmetrical(fundamentals.reshape(3, 2))).T.tolist()  # noqa: E741
    V_u2, V_u0 = unbalance_of(U)
    I_u2, I_u0 = unbalance_of(I)
    return {
        "V_23": line[1], "V_31": line[2],
        "V_pos": U[1], "V_u2": V_u2, "V_u0": V_u0, "I_u2": I_u2, "I_u0": I_u0,
        "I_n_derived": neutral,
        "Se": effective_apparent(phase["Vrms"].tolist(), line, phase["Irms"].tolist(), neutral),
        "rotation": rotation(U),
    }  # fmt: skip
