"""Is a meter wired as it should be? Phasors of the fundamentals, and what they say.

A load draws power in every phase, and a nearly balanced one lags by the same angle everywhere. Of all permutations and
reversals of the current transformers the one that makes the angles alike, and no power negative, is named. What another
wiring explains no better is no finding: a load that feeds back, single-phase loads, a rotating field to the left. Of
two phases (split-phase mains) only a current against the other shows, of one phase nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acqd.metering.candidate_wiring import LAGS_deg, Wiring, all_wirings
from acqd.metering.current_ratio import NEAR, beyond_rated, wrong_ratio
from acqd.metering.phasors import Phasors
from acqd.metering.wired_voltages import wrong_voltages
from acqd.metering.wiring_finding import WiringFinding

_SMALL = 0.03
"""Of the largest current: below it the angle means nothing."""
_ALIKE_deg = 30.0
"""Spread of the angles of a nearly balanced load."""
LEADING_deg = -35.0
"""A balanced load that leads by more is a rotated set of transformers rather than a capacitor."""
_EQUAL, _SAME_LOAD_deg = 0.6, 8.0
"""Currents so alike [share of the largest] with angles so alike in another order are one load, and not three."""
_TIE = 1.5
"""Difference of costs up to which nothing tells three reversed transformers from a rotated set."""
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
_POWER = 0.15
"""How near the power must be to the expected one [share of S] to decide."""


def examine(found: Phasors, expected_W: float | None = None, rated_W: float | None = None) -> list[WiringFinding]:
    """What is wrong with the wiring of one to three phases; empty: nothing that the phasors show.

    `expected_W`: power that a model of the load predicts for the same time; it decides between wirings that differ in
    the power, and shows wrong ratios. `rated_W`: the most that the load takes for long, from its nameplate.
    """
    if len(found.U) != 3:
        return _few(found)
    if voltages := wrong_voltages(found.U):
        return voltages
    wirings = all_wirings(found)
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
    found: Phasors, wirings: list[Wiring], expected_W: float | None, rated_W: float | None
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


def _currents(found: Phasors, candidates: list[Wiring], expected_W: float | None) -> list[WiringFinding]:
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


def _named(best: Wiring, candidates: Sequence[Wiring], known: bool) -> WiringFinding:
    """The best wiring, and what explains the phasors as well unless the power is `known`."""
    found = best.finding()
    if known or best.order == (0, 1, 2):
        return (
            replace(found, text=f"{found.text} (unless the load feeds back)") if best.against and not known else found
        )
    against = next(one for one in candidates if one.against)
    if not LAGS_deg[0] < against.common < LAGS_deg[1]:
        return found
    text = f"{found.text}, or all three currents are reversed: the power of the load decides"
    return WiringFinding(text) if against.cost - best.cost < _TIE else replace(found, text=text)


def _lone_reversal(healthy: Wiring) -> list[WiringFinding]:
    """One phase that returns what the two others draw, although their angles differ: single-phase loads."""
    back = [k for k in range(3) if abs(healthy.lag[k]) > _BACK_deg]
    return (
        [_reversal(back)]
        if len(back) == 1 and all(abs(a) < 90 for k, a in enumerate(healthy.lag) if k not in back)
        else []
    )


def _reversal(phases: Sequence[int]) -> WiringFinding:
    sign = tuple(-1 if k in phases else 1 for k in range(3))
    return WiringFinding(Wiring.words((0, 1, 2), sign), (1, 2, 3), sign)
