"""IEC 62586-2 and IEC 61000-4-30, class A: what 10/12-cycle intervals and longer ones say of steady signals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.conformance import limits
from acqd.conformance.instrument import Instrument
from acqd.conformance.point import Point, judged
from acqd.conformance.points.states import BETWEEN, STATES
from acqd.conformance.signal import START_NS, Mains, Signal, balanced
from acqd.metering.quality.bands import LINES, BROAD_Hz, LOWEST_Hz, NARROW_Hz
from acqd.metering.quality.quantities import Options
from acqd.metering.quality.telegram import SIGNALLING

STANDARD = "IEC 62586-2 / IEC 61000-4-30, class A"
_PHASES = ("L1", "L2", "L3")
_STEADY_S = 1.6
_TEN_S = 10.5
_INTERVAL_S = 0.2
"""Of 10 or 12 cycles."""
_LINES, _BANDS = "IEC 61000-4-7, lines of 5 Hz", "IEC 61000-4-7 annex B, bands from 2 to 9 kHz"


def frequency(instrument: Instrument) -> Iterator[Point]:
    """f of 10 s over the range of class A, and beside harmonics."""
    terminal = instrument.terminal
    nominal, U = float(terminal.f_nominal), balanced(terminal.declared_voltage)
    third = {3: (0.1 * terminal.declared_voltage, 0.5), 5: (0.06 * terminal.declared_voltage, 2.0)}
    cases: list[tuple[float, dict[int, tuple[float, float]], str]] = [
        (share * nominal, {}, "") for share in (0.85, 0.9, 1.0 + 0.37 / nominal, 1.1, 1.15)
    ]
    cases.append((nominal * 0.9946, third, ", H3 10 %, H5 6 %"))
    for f, harmonics, more in cases:
        signal = Signal(f"{f:.4g} Hz, Udin{more}, 10 s", Mains(f, U, harmonics=harmonics), _TEN_S)
        found = instrument.read(signal, "quality").of("10s", "f", "total")
        yield judged(STANDARD, "power frequency", signal.text, "f of 10 s", limits.FREQUENCY, [(found - f) * 1e3])


def states(instrument: Instrument) -> Iterator[Point]:
    """Magnitude, frequency, harmonics, interharmonics and unbalance in the three testing states."""
    terminal = instrument.terminal
    declared = terminal.declared_voltage
    for state in STATES:
        signal, f = state.signal(terminal, _STEADY_S), state.hertz(terminal)
        readings = instrument.read(signal, "quality")
        extra = sum(share**2 for share, _ in state.harmonics.values()) + (BETWEEN**2 if state.between else 0.0)
        truth = [np.sqrt(magnitude**2 + extra) for magnitude in state.magnitudes]
        off = [readings.of("10/12", "Vrms", name) / declared - V for name, V in zip(_PHASES, truth, strict=True)]
        yield judged(
            STANDARD, "magnitude", signal.text, "Vrms of 10/12 cycles", limits.MAGNITUDE, [100 * one for one in off]
        )
        off_f = readings.of("10/12", "f", "total") - f
        yield judged(STANDARD, "power frequency", signal.text, "f of 10/12 cycles", limits.FREQUENCY, [1e3 * off_f])
        low, middle, _ = state.magnitudes
        u2 = 100 * abs(middle - low) / np.sqrt(3) / middle
        off = [readings.of("10/12", name, "total") - u2 for name in ("V_u2", "V_u0")]
        yield judged(STANDARD, "unbalance", signal.text, "u2 and u0", limits.UNBALANCE, off)
        wanted, between = np.zeros(50), np.zeros(50)
        for h, (share, _) in state.harmonics.items():
            wanted[h - 1] = share
        if state.between:
            between[int(state.between)] = BETWEEN
        for parameter, name, of_all in (("harmonics", "V_h", wanted), ("interharmonics", "V_ih", between)):
            groups = [readings.of("10/12", name, phase) / declared for phase in _PHASES]
            yield from _groups(parameter, signal.text, groups, of_all, state.magnitudes)


def _groups(
    parameter: str, text: str, groups: list[Floats], wanted: Floats, magnitudes: tuple[float, ...]
) -> Iterator[Point]:
    """Shares of Udin by phase [intervals, 50], compared by the rule of IEC 61000-4-7 for large and small groups."""
    large, small = [], []
    for found, magnitude in zip(groups, magnitudes, strict=True):
        truth = wanted.copy()
        if parameter == "harmonics":
            truth[0] = magnitude
        known = truth >= 0.01
        large.append(100 * (found[:, known] / truth[known] - 1))
        small.append(100 * (found[:, ~known] - truth[~known]))
    if any(one.size for one in large):
        yield judged(STANDARD, parameter, text, "groups of 1 % and more", limits.HARMONIC, large)
    yield judged(STANDARD, parameter, text, "all other groups", limits.HARMONIC_SMALL, small)


def magnitudes(instrument: Instrument) -> Iterator[Point]:
    """Vrms from a tenth to one and a half of Udin, and its deviations from Udin."""
    terminal = instrument.terminal
    for share in (0.1, 0.45, 0.8, 1.15, 1.5):
        if share * terminal.declared_voltage * np.sqrt(2) > terminal.range_v:
            continue
        U = balanced(share * terminal.declared_voltage)
        signal = Signal(f"{100 * share:g} % of Udin", Mains(float(terminal.f_nominal), U), 0.8)
        readings = instrument.read(signal, "quality")
        off = [100 * (readings.of("10/12", "Vrms", name) / terminal.declared_voltage - share) for name in _PHASES]
        yield judged(STANDARD, "magnitude", signal.text, "Vrms of 10/12 cycles", limits.MAGNITUDE, off)
        for quantity, deviation in (("V_under", 100 - 100 * share), ("V_over", 100 * share - 100)):
            off = [readings.of("10/12", quantity, name) - max(deviation, 0.0) for name in _PHASES]
            yield judged(STANDARD, "deviation", signal.text, quantity, limits.MAGNITUDE, off)


def unbalances(instrument: Instrument) -> Iterator[Point]:
    """u2 and u0 of 0 to 5 %."""
    terminal = instrument.terminal
    for low, high in ((1.0, 1.0), (0.97, 1.02), (0.9, 1.05)):
        shares = np.array((1.0, low, high))
        a = np.exp(2j * np.pi / 3)
        phasors = shares * np.array((1, 1 / a, a))
        positive, negative = abs(phasors @ (1, a, a * a)), abs(phasors @ (1, a * a, a))
        zero = abs(phasors.sum())
        U = terminal.declared_voltage
        signal = Signal(
            f"U {100:g}, {100 * low:g}, {100 * high:g} % of Udin, 120 degrees apart",
            Mains(float(terminal.f_nominal), (U, U * low, U * high)),
            0.8,
        )
        readings = instrument.read(signal, "quality")
        for name, part in (("V_u2", negative), ("V_u0", zero)):
            off = readings.of("10/12", name, "total") - 100 * part / positive
            yield judged(STANDARD, "unbalance", signal.text, name[2:], limits.UNBALANCE, [off])


def signallings(instrument: Instrument) -> Iterator[Point]:
    """Mains signalling at a carrier between the lines of the spectrum and at one on a line."""
    terminal = instrument.terminal
    U = terminal.declared_voltage
    for carrier, share in ((316.67, 0.03), (316.67, 0.15), (1060.0, 0.05)):
        mains = Mains(float(terminal.f_nominal), balanced(U), tones={carrier: share * U})
        signal = Signal(f"Udin, {100 * share:g} % at {carrier:g} Hz", mains, 1.0)
        readings = instrument.read(signal, "quality", options=Options(signalling_Hz=carrier))
        off = [100 * (readings.of("10/12", "V_ms", name) / (share * U) - 1) for name in _PHASES]
        yield judged(STANDARD, "mains signalling", signal.text, "V_ms", limits.SIGNALLING, off)
    yield from _telegram(instrument)


def _telegram(instrument: Instrument) -> Iterator[Point]:
    """A telegram is recorded from the interval on that it begins in, for the time that is set, and nothing before."""
    terminal = instrument.terminal
    U, carrier, begins, lasts = terminal.declared_voltage, 316.67, 1.1, 1.6
    mains = Mains(float(terminal.f_nominal), balanced(U), tones={carrier: 0.01 * U})
    plain = Mains(float(terminal.f_nominal), balanced(U))

    def keyed(t: Floats) -> Floats:
        return np.where(((t >= begins) & (t < begins + 0.5))[:, None], mains(t), plain(t))

    signal = Signal(f"Udin, 1 % at {carrier:g} Hz for 0.5 s from {begins:g} s on", keyed, 4.0)
    options = Options(signalling_Hz=carrier, signalling_threshold=0.003, signalling_s=lasts)
    rows = instrument.read(signal, "quality", options=options).aggregated("10/12", "L1")
    starts = (_utc_ns(rows) - START_NS) * 1e-9
    recorded = np.array([SIGNALLING in row["flags"] for row in rows])
    wanted = (starts > begins - _INTERVAL_S) & (starts < begins - _INTERVAL_S + lasts)
    off = (recorded != wanted).astype(np.float64).sum()
    yield judged(STANDARD, "mains signalling", signal.text, "recorded intervals", limits.RECORDED, [off])


def low_lines_and_bands(instrument: Instrument) -> Iterator[Point]:
    """Lines of 5 Hz up to 100 Hz, and bands of 200 Hz and 1 kHz from 2 kHz on, as far as the sampling rate reaches."""
    terminal = instrument.terminal
    nominal, U, size = float(terminal.f_nominal), terminal.declared_voltage, 0.02 * terminal.declared_voltage
    for f in (5.0, 35.0, 95.0):
        signal = Signal(f"Udin, 2 % at {f:g} Hz", Mains(nominal, balanced(U), tones={f: size}), _STEADY_S)
        readings = instrument.read(signal, "quality", options=Options(lines=True))
        expected = np.zeros(LINES)
        expected[round(f / 5)], expected[round(nominal / 5)] = size, U
        known = expected > 0
        found = [readings.of("10/12", "V_lines", phase) for phase in _PHASES]
        off = [100 * (one[:, known] / expected[known] - 1) for one in found]
        yield judged(_LINES, "lines of 5 Hz", signal.text, "V_lines", limits.HARMONIC, off)
        off = [100 * one[:, ~known] / U for one in found]
        yield judged(_LINES, "lines of 5 Hz", signal.text, "all other lines", limits.HARMONIC_SMALL, off)
    reaches = 0.4 * terminal.rate
    for f in (2_105.0, 4_900.0, 7_310.0, 8_950.0):
        upper = LOWEST_Hz + BROAD_Hz * (1 + (f - LOWEST_Hz) // BROAD_Hz)
        if upper > reaches:
            continue
        signal = Signal(f"Udin, 2 % at {f:g} Hz", Mains(nominal, balanced(U), tones={f: size}), _STEADY_S)
        readings = instrument.read(signal, "quality", options=Options(bands=True))
        for name, width in (("V_bands", NARROW_Hz), ("V_bands_1k", BROAD_Hz)):
            band = int((f - LOWEST_Hz) // width)
            found = [readings.of("10/12", name, phase) for phase in _PHASES]
            off = [100 * (one[:, band] / size - 1) for one in found]
            yield judged(_BANDS, "bands", signal.text, name, limits.HARMONIC, off)
            off = [100 * np.nan_to_num(np.delete(one, band, axis=1)) / U for one in found]
            yield judged(_BANDS, "bands", signal.text, f"all other {name}", limits.HARMONIC_SMALL, off)


def aggregation(instrument: Instrument) -> Iterator[Point]:
    """A 10/12-cycle interval begins at the ten-minute tick, and fifteen of them make a 150/180-cycle value."""
    terminal = instrument.terminal
    f = terminal.f_nominal * 0.9973
    signal = Signal(
        f"{f:.4g} Hz, Udin, from 4 s before a ten-minute tick to 4 s after it",
        Mains(f, balanced(terminal.declared_voltage)),
        8.0,
        START_NS - 4 * 10**9,
    )
    readings = instrument.read(signal, "quality")
    starts = _utc_ns(readings.aggregated("10/12", "L1"))
    nearest = np.abs(starts - START_NS).min(initial=10**12) * 1e-6
    yield judged(
        STANDARD, "aggregation", signal.text, "start of the interval at the tick", limits.AGGREGATION, [nearest]
    )
    longer = readings.of("150/180", "intervals", "L1")
    off = np.abs(longer - 15)
    yield judged(STANDARD, "aggregation", signal.text, "intervals of 150/180 cycles", limits.INTERVALS, [off])


def _utc_ns(rows: list[Mapping[str, Any]]) -> NDArray[np.int64]:
    """Starts [ns]: FILETIME counts 100 ns since 1601."""
    return (np.array([row["filetime"] for row in rows], dtype=np.int64) - 116_444_736_000_000_000) * 100


def harmonic_orders(instrument: Instrument) -> Iterator[Point]:
    """IEC 61000-4-7: every order of voltage and current alone large enough to be judged, and each gap between two."""
    terminal = instrument.terminal
    nominal, U, I = float(terminal.f_nominal), terminal.declared_voltage, terminal.nominal_current  # noqa: E741
    f = nominal * 1.004
    random = np.random.default_rng(7)
    share, standard = 0.02, "IEC 61000-4-7, class I"
    amperes = 0.03 * I  # of a harmonic: all of them together must stay within the range
    known = int(min(50, 0.4 * terminal.rate / f - 0.2))
    orders = range(2, known + 1)
    harmonics = {h: (share, float(random.uniform(0, 2 * np.pi))) for h in orders}
    mains = Mains(
        f, balanced(U), balanced(I / 2),
        harmonics={h: (size * U, angle) for h, (size, angle) in harmonics.items()},
        current_harmonics={h: (amperes, angle) for h, (_, angle) in harmonics.items()},
    )  # fmt: skip
    signal = Signal(f"{f:.4g} Hz, H2 to H{known} of 2 % of Udin and 3 % of In", mains, 0.8)
    readings = instrument.read(signal, "quality")
    for name, size, limit in (("V_h", share * U, limits.HARMONIC), ("I_h", amperes, limits.CURRENT_HARMONIC)):
        off = [100 * (readings.of("10/12", name, phase)[:, 1:known] / size - 1) for phase in _PHASES]
        yield judged(standard, "harmonics", signal.text, f"subgroups 2 to {known} of {name[0]}", limit, off)
    for between in (1.5, 6.5, 23.5, known - 0.5):
        mains = Mains(f, balanced(U), tones={between * f: share * U})
        signal = Signal(f"{f:.4g} Hz, interharmonic of 2 % at {between:g} f", mains, 0.8)
        found = [instrument.read(signal, "quality").of("10/12", "V_ih", "L1")[:, int(between)]]
        off = [100 * (one / (share * U) - 1) for one in found]
        yield judged(standard, "interharmonics", signal.text, "centred subgroup", limits.HARMONIC, off)
