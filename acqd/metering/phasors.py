"""Is a meter wired as it should be? Phasors of the fundamentals, and what they say.

A load draws power in every phase, and a nearly balanced one lags by the same angle everywhere. Of all permutations and
reversals of the current transformers the one that makes the angles alike, and no power negative, is named. What another
wiring explains no better is no finding: a load that feeds back, single-phase loads, a rotating field to the left. Of
two phases (split-phase mains) only a current against the other shows, of one phase nothing.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from acqd.arrays import Floats
from acqd.metering.current_ratio import NEAR, beyond_rated, wrong_ratio

_FLOATING = 0.5
"""Of the median of the voltages: below it a phase is missing or picks up its neighbours."""
_DEAD = 0.09
"""Of the largest voltage: two below it are missing; above it, the third has another ratio."""
_SMALL = 0.03
"""Of the largest current: below it the angle means nothing."""
_SAME_deg = 20.0
"""Voltages closer than this are one."""
_RATIO = 0.15
"""How far a voltage may be from the median of the three; supplies keep within 10 % (EN 50160)."""
_ALIKE_deg = 30.0
"""Spread of the angles of a nearly balanced load."""
_LAGS_deg = (0.0, 80.0)
"""Angles of ordinary loads: motors and drives lag (power factor 1 to 0.17)."""
_BELOW_deg, _ABOVE_deg = 12.0, 6.0
"""How fast angles outside of that become unlikely."""
LEADING_deg = -35.0
"""A balanced load that leads by more is a rotated set of transformers rather than a capacitor."""
_FEEDING_deg = 12.0
"""All phases within this of 180 degrees: a source that feeds back, which is no mistake."""
_EQUAL, _SAME_LOAD_deg = 0.6, 8.0
"""Currents so alike [share of the largest] with angles so alike in another order are one load, and not three."""
_REVERSED, _MOVED = 3.0, 0.9
"""Cost of a reversed transformer, and of one in the place of another: fewer mistakes are likelier."""
_ALL_REVERSED, _TIE = 4.5, 1.5
"""Cost of three transformers that are mounted against the flow, which is one mistake; and the difference of costs up to
which nothing tells that from a rotated set."""
_RATIO_COST = 7.0
"""Cost of a ratio that is wrong in all three phases: one mistake, of the configuration."""
_FITTING = 0.3
"""How near the power of a wiring must be to the expected one [share of it] to explain the power without a ratio."""
_BACK_deg = 115.0
"""A current that lags its voltage by more flows against the power of a load."""
_AGAINST_deg = 125.0
"""The same of two phases: between lines that are 120 degrees apart, a coil makes a current of one lag by 90 + 30."""
_ONE = 0.02
"""Difference of two currents [share] that are one: loads of two phases differ by 120 degrees, or in size."""
_LATE_deg, _EQUAL_VOLTS, _STRAIGHT_deg = 3.5, 0.01, 0.5
"""A voltage that is so late or early although all three are alike in size and the two others lie 120 degrees apart:
unbalance of a supply changes sizes as well."""
_POWER = 0.15
"""How near the power must be to the expected one [share of S] to decide."""


@dataclass(frozen=True, slots=True)
class Phasors:
    """Fundamentals, complex [phases]: V and A, RMS; the first voltage that is there has the angle 0."""

    U: np.ndarray
    I: np.ndarray  # noqa: E741

    def angles_deg(self) -> Floats:
        """[phases] by which each current lags its voltage."""
        return np.asarray(np.degrees(np.angle(self.U * self.I.conj())))


@dataclass(frozen=True, slots=True)
class WiringFinding:
    """One thing that is wired otherwise than it should be."""

    text: str
    order: tuple[int, ...] = ()
    """Currents of L1, L2, L3 by their present numbers, for a correction; empty: not a matter of currents."""
    sign: tuple[int, ...] = ()
    gain: tuple[float, ...] = ()
    """True current per measured one, of L1, L2, L3, where the ratio is wrong."""

    @property
    def gains(self) -> tuple[float, ...]:
        """Sign and ratio."""
        return tuple(sign * gain for sign, gain in zip(self.sign, self.gain or (1.0,) * len(self.sign), strict=True))

    @property
    def mistake(self) -> str:
        """The text without the measured values, which differ from minute to minute."""
        return re.sub(r"\(.*?\)| [\d.e+-]+ (times|degrees)", "", self.text)

    @property
    def correction(self) -> str:
        """What to paste below `[source]`; empty where only a screwdriver helps."""
        keys = []
        if self.order and self.order != tuple(range(1, len(self.order) + 1)):
            keys.append(f"i_order = {list(self.order)}")
        if set(self.gains) - {1.0}:
            keys.append(f"i_gain = {list(self.gains)}")
        return f"[source] correction = {{ {', '.join(keys)} }}" if keys else ""

    @property
    def remedy(self) -> str:
        """What is wrong, and what to paste."""
        return f"{self.text}; {self.correction}" if self.correction else self.text


def phasors(values: Floats, rate: float, f: float) -> Phasors:
    """Of physical samples [samples, 2 * phases] at `rate` [1/s], mains of `f` [Hz]: means over tens of cycles.

    Each piece of ten cycles is turned so that U1, or the first voltage that is there, has the angle 0: f need not be
    exact.
    """
    length = round(10 * rate / f)
    pieces = max(1, len(values) // length)
    total = np.zeros(values.shape[1], dtype=complex)
    for k in range(pieces):
        x = values[k * length : (k + 1) * length]
        angle = 2 * np.pi * f / rate * np.arange(len(x))[:, None]
        x = np.sqrt(2) / len(x) * (x - x.mean(axis=0))
        # no product of matrices: threads of BLAS cost milliseconds beside real-time processes
        lines = (x * np.cos(angle)).sum(axis=0) - 1j * (x * np.sin(angle)).sum(axis=0)
        size = np.abs(lines[0::2])
        reference = 2 * int(np.argmax(size >= _FLOATING * size.max()))  # the angle of a missing voltage is noise
        total += lines * np.exp(-1j * np.angle(lines[reference]))
    return Phasors(total[0::2] / pieces, total[1::2] / pieces)


def examine(found: Phasors, expected_W: float | None = None, rated_W: float | None = None) -> list[WiringFinding]:
    """What is wrong with the wiring of one to three phases; empty: nothing that the phasors show.

    `expected_W`: power that a model of the load predicts for the same time; it decides between wirings that differ in
    the power, and shows wrong ratios. `rated_W`: the most that the load takes for long, from its nameplate.
    """
    if len(found.U) != 3:
        return _few(found)
    if voltages := _voltages(found.U):
        return voltages
    wirings = _all(found)
    return _ratio(found, wirings, expected_W, rated_W) or _currents(found, wirings, expected_W) or _one_conductor(found)


def _few(found: Phasors) -> list[WiringFinding]:
    """Two phases of which one returns what the other draws. All of them return power where a source feeds back."""
    size, lag = np.abs(found.I), np.abs(found.angles_deg())
    if not np.abs(found.U).min() or size.min() < _SMALL * size.max() or lag.min() > 90:
        return []
    back = int(np.argmax(lag))
    if lag[back] < _AGAINST_deg:
        return []
    sign = tuple(-1 if k == back else 1 for k in range(len(lag)))
    return [WiringFinding(f"i{back + 1} is reversed (unless the load feeds back)", tuple(range(1, len(lag) + 1)), sign)]


def _one_conductor(found: Phasors) -> list[WiringFinding]:
    """What no other wiring explains: one conductor in two transformers."""
    size = np.abs(found.I)
    for a, b in ((0, 1), (0, 2), (1, 2)):
        if size[a] > _SMALL * size.max() and abs(found.I[a] - found.I[b]) < _ONE * size[a]:
            return [WiringFinding(f"i{a + 1} and i{b + 1} are the same current: two transformers on one conductor?")]
    return []


def _ratio(
    found: Phasors, wirings: list[_Wiring], expected_W: float | None, rated_W: float | None
) -> list[WiringFinding]:
    """A wrong ratio, of the wiring that is likeliest if nobody knows the power."""
    size, healthy = np.abs(found.I), wirings[0]
    if (expected_W is None and rated_W is None) or not size.max():
        return []
    if expected_W is not None and abs(healthy.power - expected_W) < NEAR * abs(expected_W):
        return []
    best = healthy if healthy.draws and healthy.spread < _ALIKE_deg else min(wirings, key=lambda one: one.cost)
    if best.spread > _ALIKE_deg or not best.draws:
        return []
    if expected_W is None:
        wrong = beyond_rated(best.powers, rated_W or 0.0)
    else:
        near = _POWER * float((np.abs(found.U) * size).sum())
        plain = [one for one in wirings if one.draws and one.spread < _ALIKE_deg]
        fitting = [one.cost for one in plain if abs(one.power - expected_W) < min(near, _FITTING * expected_W)]
        if fitting and min(fitting) < best.cost + _RATIO_COST:
            return []
        wrong = wrong_ratio(best.powers, size[list(best.order)], expected_W)
    if wrong is None:
        return []
    text = f"{best.words(best.order, best.sign)}, and {wrong.text}" if best.changed else wrong.text
    return [WiringFinding(text, tuple(k + 1 for k in best.order), best.sign, wrong.gain)]


def _voltages(U: np.ndarray) -> list[WiringFinding]:
    size = np.abs(U)
    median = float(np.median(size))
    if not median:
        return []
    reference = median if median > _DEAD * float(size.max()) else float(size.max())  # of two that are missing
    low = [f"u{k + 1}" for k in range(3) if size[k] < _FLOATING * reference]
    if low:
        return [WiringFinding(f"{' and '.join(low)} missing or floating ({_volts(size)}): check fuse and terminal")]
    pairs = [(a, b) for a, b in ((0, 1), (0, 2), (1, 2)) if abs(_between(U[a], U[b])) < _SAME_deg]
    if pairs:
        a, b = pairs[0]
        return [WiringFinding(f"u{a + 1} and u{b + 1} are the same voltage: one of them is wired to the other's phase")]
    odd = [k for k in range(3) if abs(size[k] / median - 1) > _RATIO]
    ratio = size[odd[0]] / median if odd else 1.0
    between_lines = abs(ratio / np.sqrt(3) - 1) < 0.05
    reversed_ = _reversed_voltage(U)
    if reversed_ is not None and not between_lines:
        return [WiringFinding(f"u{reversed_ + 1} is reversed (180 degrees): exchange its two wires")]
    if odd:
        hint = "; is it a voltage between lines?" if between_lines else ""
        return [WiringFinding(f"u{odd[0] + 1} is {ratio:.3g} times the others ({_volts(size)}): check its ratio{hint}")]
    return _late(U)


def _late(U: np.ndarray) -> list[WiringFinding]:
    """One voltage that is as large as the others, and not 120 degrees from them."""
    if np.ptp(np.abs(U)) > _EQUAL_VOLTS * float(np.abs(U).min()):
        return []
    turn = np.sign(_between(U[0], U[1])) * 120  # the rotating field
    error = [(_between(U[k], U[(k + 1) % 3]) - turn + 180) % 360 - 180 for k in range(3)]  # from phase k to the next
    for k in range(3):
        after, straight, before = error[k], error[(k + 1) % 3], error[(k + 2) % 3]
        if abs(straight) < _STRAIGHT_deg and _LATE_deg < abs(before) < _ALIKE_deg and abs(after + before) < 1.0:
            text = f"u{k + 1} is {abs(before):.2g} degrees {'late' if before < 0 else 'early'}"
            return [WiringFinding(f"{text}: do its samples come at another time than the others (u_delay_us)?")]
    return []


def _volts(size: Floats) -> str:
    return ", ".join(f"{value:.4g} V" for value in size)


def _between(a: complex, b: complex) -> float:
    """Angle from a to b [degrees]."""
    return float(np.degrees(np.angle(b * np.conj(a))))


def _reversed_voltage(U: np.ndarray) -> int | None:
    """The voltage whose reversal makes three of 120 degrees; None where they are, or where none does."""
    if _symmetric(U):
        return None
    return next((k for k in range(3) if _symmetric(np.where(np.arange(3) == k, -U, U))), None)


def _symmetric(U: np.ndarray) -> bool:
    return all(abs(abs(_between(U[a], U[b])) - 120) < 30 for a, b in ((0, 1), (1, 2), (2, 0)))


def _currents(found: Phasors, candidates: list[_Wiring], expected_W: float | None) -> list[WiringFinding]:
    size = np.abs(found.I)
    if size.min() < _SMALL * size.max() or not size.max():
        return []
    healthy = candidates[0]
    if expected_W is not None:
        near = _POWER * float((np.abs(found.U) * np.abs(found.I)).sum())
        candidates = [one for one in candidates if abs(one.power - expected_W) < near]
        if not candidates:
            return []  # a load that the model does not know
    best = min(candidates, key=lambda one: one.cost)
    if expected_W is None or abs(healthy.power - expected_W) < near:
        leading = healthy.spread < _ALIKE_deg / 2 and healthy.common < LEADING_deg and expected_W is None
        balanced = size.min() > _EQUAL * size.max() and healthy.spread > _ALIKE_deg and best.spread < _SAME_LOAD_deg
        if healthy.draws and not leading and not balanced:
            return []
        if healthy.returns:
            return []  # a load that feeds back, or all transformers reversed: nothing here tells which
    if best.spread > _ALIKE_deg or not (best.draws or expected_W is not None):
        return _lone_reversal(healthy)
    return [_named(best, candidates, expected_W is not None)] if best.changed else []


def _named(best: _Wiring, candidates: Sequence[_Wiring], known: bool) -> WiringFinding:
    """The best wiring, and what explains the phasors as well unless the power is `known`."""
    found = best.finding()
    if known or best.order == (0, 1, 2):
        return (
            replace(found, text=f"{found.text} (unless the load feeds back)") if best.against and not known else found
        )
    against = next(one for one in candidates if one.against)
    if not _LAGS_deg[0] < against.common < _LAGS_deg[1]:
        return found
    text = f"{found.text}, or all three currents are reversed: the power of the load decides"
    return WiringFinding(text) if against.cost - best.cost < _TIE else replace(found, text=text)


def _lone_reversal(healthy: _Wiring) -> list[WiringFinding]:
    """One phase that returns what the two others draw, although their angles differ: single-phase loads."""
    back = [k for k in range(3) if abs(healthy.lag[k]) > _BACK_deg]
    return (
        [_reversal(back)]
        if len(back) == 1 and all(abs(a) < 90 for k, a in enumerate(healthy.lag) if k not in back)
        else []
    )


def _reversal(phases: Sequence[int]) -> WiringFinding:
    sign = tuple(-1 if k in phases else 1 for k in range(3))
    return WiringFinding(_Wiring.words((0, 1, 2), sign), (1, 2, 3), sign)


def _all(found: Phasors) -> list[_Wiring]:
    """The present wiring first."""
    return [_Wiring(order, sign, found) for order in permutations(range(3)) for sign in product((1, -1), repeat=3)]


class _Wiring:
    """Currents in another order and direction."""

    def __init__(self, order: tuple[int, ...], sign: tuple[int, ...], found: Phasors) -> None:
        self.order, self.sign = order, sign
        currents = found.I[list(order)] * np.array(sign)
        self.lag = np.degrees(np.angle(found.U * currents.conj()))
        self.powers = (found.U * currents.conj()).real
        self.power = float(self.powers.sum())
        mean = np.exp(1j * np.radians(self.lag)).mean()
        self.common = float(np.degrees(np.angle(mean)))
        around = (self.lag - self.common + 180) % 360 - 180
        self.spread = float(np.abs(around).max())
        moved = sum(a != k for k, a in enumerate(order))
        self.against = order == (0, 1, 2) and max(sign) < 0
        mistakes = _ALL_REVERSED if self.against else sum(one < 0 for one in sign) * _REVERSED + moved * _MOVED
        low, high = _LAGS_deg
        unusual = max(0.0, (low - self.common) / _BELOW_deg, (self.common - high) / _ABOVE_deg)
        self.cost = mistakes + (self.spread / 8) ** 2 + min(unusual, 20.0) ** 2
        self.changed = order != (0, 1, 2) or min(sign) < 0

    @property
    def draws(self) -> bool:
        """Whether every phase draws power."""
        return bool((np.abs(self.lag) < 90).all())

    @property
    def returns(self) -> bool:
        """Whether every phase returns nothing but active power."""
        return self.spread < _FEEDING_deg and abs(abs(self.common) - 180) < _FEEDING_deg

    def finding(self) -> WiringFinding:
        """In words, with the correction."""
        return WiringFinding(self.words(self.order, self.sign), tuple(k + 1 for k in self.order), self.sign)

    @staticmethod
    def words(order: tuple[int, ...], sign: tuple[int, ...]) -> str:
        """What is wrong, and what to change."""
        parts = []
        moved = [k for k in range(3) if order[k] != k]
        if len(moved) == 2:
            parts.append(f"the currents of L{moved[0] + 1} and L{moved[1] + 1} are exchanged")
        elif moved:
            parts.append(
                "the currents are rotated: " + ", ".join(f"i{order[k] + 1} is that of L{k + 1}" for k in range(3))
            )
        back = [f"i{order[k] + 1}" for k in range(3) if sign[k] < 0]
        if back:
            parts.append(f"{' and '.join(back)} {'is' if len(back) == 1 else 'are'} reversed")
        return " and ".join(parts)
