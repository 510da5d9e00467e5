"""The limits that points are judged by, and where each number is from.

The texts of the standards were not at hand. A limit is here when a public source quotes it, or when the tests of acqd
had it before (`_TESTS`: check these first where a text comes to hand); points without either are listed in `LEFT_OUT`,
by name, and are not on the sheet.
"""

from __future__ import annotations

from acqd.conformance.point import Limit

_DATA_SHEETS = "IEC 61000-4-30 class A, as data sheets of class A instruments quote it"
_TESTS = ", as the tests of acqd had it before; no public source was at hand"
FREQUENCY = Limit(10.0, "mHz", _DATA_SHEETS + " (10 s, 42.5 to 57.5 Hz, 51 to 69 Hz)")
MAGNITUDE = Limit(0.1, "% of Udin", _DATA_SHEETS + " (10 to 150 % of Udin)")
RESIDUAL = Limit(0.2, "% of Udin", "IEC 61000-4-30 class A" + _TESTS)
DURATION = Limit(1.0, "cycles", _DATA_SHEETS + ": +-1 cycle")
START = Limit(0.5, "cycles", "half of the cycle that the duration is allowed: one half at each end")
UNBALANCE = Limit(0.15, "percentage points", _DATA_SHEETS)
HARMONIC = Limit(5.0, "% of the value", "IEC 61000-4-7 class I, from 1 % of nominal on" + _TESTS)
HARMONIC_SMALL = Limit(0.05, "% of Udin", "IEC 61000-4-7 class I, below 1 % of nominal" + _TESTS)
CURRENT_HARMONIC = Limit(5.0, "% of the value", "IEC 61000-4-7 class I, from 3 % of nominal on" + _TESTS)
SIGNALLING = Limit(5.0, "% of the value", _DATA_SHEETS + " (3 to 15 % of Udin)")
RECORDED = Limit(0.0, "intervals too many or missing", "IEC 61000-4-30, 5.10: recorded for a set time")
PST = Limit(5.0, "%", "IEC 61000-4-15, as the test bench of QWTB's flicker_sim and data sheets quote it")
AGGREGATION = Limit(1.0, "ms", "IEC 61000-4-30, 4.5: intervals restart at the ten-minute tick; 1 ms is acqd's choice")
COUNT = Limit(0.0, "events too many or missing", "IEC 61000-4-30, 5.4 and 5.5: definition of the event")

INTERVALS = Limit(
    0.0, "intervals too many or missing", "IEC 61000-4-30, 4.5.2: fifteen intervals make a 150/180-cycle value"
)

_CLASS_05S = "IEC 62053-22 class 0.5 S, table of errors"
_CLASS_1 = "IEC 62053-21 class 1, table of errors, as the tests of the crate metrology_insight quote it"
ENERGY_05S: tuple[tuple[float, float, float], ...] = (
    (0.01, 1.0, 1.0), (0.05, 1.0, 0.5), (0.2, 1.0, 0.5), (1.0, 1.0, 0.5), (1.2, 1.0, 0.5),
    (0.02, 0.5, 1.0), (0.1, 0.5, 0.6), (1.0, 0.5, 0.6), (1.2, 0.5, 0.6),
    (0.02, -0.8, 1.0), (0.1, -0.8, 0.6), (1.0, -0.8, 0.6), (1.2, -0.8, 0.6),
)  # fmt: skip
"""Current in In (1.2: Imax), power factor (negative: capacitive), limit in %; balanced load."""
ENERGY_1: tuple[tuple[float, float, float], ...] = (
    (0.05, 1.0, 1.5), (0.1, 1.0, 1.0), (0.5, 1.0, 1.0), (1.0, 1.0, 1.0), (1.2, 1.0, 1.0),
    (0.1, 0.5, 1.5), (0.2, 0.5, 1.0), (0.5, 0.5, 1.0), (1.0, 0.5, 1.0), (0.5, -0.8, 1.0), (1.0, -0.8, 1.0),
)  # fmt: skip
SINGLE_PHASE = Limit(2.0, "%", _CLASS_1)
"""Of the total, when a single phase has a load."""
INFLUENCED = (
    "IEC 62053-22 class 0.5 S: the error at reference conditions, {value:g} %; the limits of variation were not at hand"
)
STARTING = Limit(10.0, "%", "IEC 62053-22: the meter registers at 0.1 % of In; 10 % of the energy is acqd's choice")
NO_LOAD = Limit(0.0, "Wh", "IEC 62053-22: nothing is registered at 115 % of Un without current" + _TESTS)


def energy(value: float, household: bool) -> Limit:
    """Error of the energy in %; `household`: class 1, else class 0.5 S."""
    return Limit(value, "%", _CLASS_1 if household else _CLASS_05S)


def influenced(value: float) -> Limit:
    """Error of the energy under an influence quantity."""
    return Limit(value, "%", INFLUENCED.format(value=value))


_PHASOR = "IEC/IEEE 60255-118-1:2018 class P, as a public test program of the standard quotes it"
PHASOR_STEADY = Limit(1.0, "%", _PHASOR), Limit(0.005, "Hz", _PHASOR), Limit(0.4, "Hz/s", _PHASOR)
"""TVE, frequency error, ROCOF error."""
PHASOR_RAMP = Limit(1.0, "%", _PHASOR), Limit(0.01, "Hz", _PHASOR), Limit(0.4, "Hz/s", _PHASOR)
PHASOR_RESPONSE = Limit(2.0, "cycles", _PHASOR)
PHASOR_MODULATED = Limit(3.0, "%", _PHASOR), Limit(0.06, "Hz", _PHASOR), Limit(2.26, "Hz/s", _PHASOR)
"""Of modulations up to 2 Hz."""

LEFT_OUT = (
    "IEC 62586-2: its own numbering of points, single influence quantities, temperature and supply voltage: the text "
    "was not at hand; signals are those that public sources quote",
    "IEC 61000-4-30: rapid voltage changes in volts, magnitude of the current: no public source of the limits",
    "IEC 61000-4-30: clock of class A: the uncertainty of the time is that of the computer's clock",
    "IEC 61000-4-15: tests with several changes, phase jumps, crest factors and 20 % duty cycle: no public source",
    "IEC 62053-21 and -22: limits of variation; temperature, magnetic fields, EMC, supply: not of the method",
    "IEC 60255-118-1: class M, latency, overshoot and the response of f and ROCOF; no PMU: acqd reports phasors of "
    "recordings (acqd replay --phasors) and sends no C37.118 frames",
)
"""What the sheet does not hold, and why."""
