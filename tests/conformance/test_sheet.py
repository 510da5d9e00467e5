"""Points of the sheet are within their limits, and meters that are broken on purpose turn the right ones red."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from acqd.conformance.instrument import Instrument
from acqd.conformance.point import Limit, judged
from acqd.conformance.sheet import GROUPS, points_of
from acqd.conformance.terminal import Terminal


@pytest.fixture(scope="module")
def instrument():
    return Instrument(Terminal())


@pytest.mark.parametrize(
    "group",
    [
        "states",
        "magnitude",
        "unbalance",
        "harmonics",
        "signalling",
        "lines-and-bands",
        "aggregation",
        "dips",
        "interruptions",
    ],
)
def test_every_point_of_power_quality_is_within_class_a(instrument, group):
    points = points_of(instrument, group)
    assert points and [point for point in points if not point.passed] == []


@pytest.mark.parametrize(
    ("group", "first", "last"),
    [("energy", 0, 2), ("influence", 9, 14), ("no-load", 0, 2), ("phasors", 0, 6), ("phasors-dynamic", 9, 12)],
)
def test_points_of_energy_and_phasors_are_within_their_class(instrument, group, first, last):
    points = list(islice(GROUPS[group](instrument), first, last))
    assert len(points) == last - first and [point for point in points if not point.passed] == []


@pytest.mark.slow
@pytest.mark.parametrize("nominal", [50, 60])
@pytest.mark.parametrize("group", GROUPS)
def test_every_point_is_within_its_limit(group, nominal):
    assert all(point.passed for point in points_of(Instrument(Terminal(f_nominal=nominal)), group))


def failed(instrument, *groups):
    """What has failed: parameter and quantity."""
    points = [point for group in groups for point in points_of(instrument, group)]
    return {(point.parameter, point.quantity) for point in points if not point.passed}


class GainOff(Instrument):
    """Voltages read 0.3 % too high."""

    def blocks(self, signal):
        for block in super().blocks(signal):
            codes = block.codes.copy()
            codes[:, 0::2] = np.rint(codes[:, 0::2] * 1.003)
            yield replace(block, codes=codes)


def test_a_gain_that_is_off_fails_magnitudes_and_not_unbalance():
    wrong = {("magnitude", "Vrms of 10/12 cycles"), ("deviation", "V_under"), ("deviation", "V_over")}
    assert failed(GainOff(Terminal()), "magnitude", "unbalance") == wrong


class CycleLate(Instrument):
    """Everything is stamped a cycle late."""

    def blocks(self, signal):
        return (replace(block, utc_ns=block.utc_ns + 20_000_000) for block in super().blocks(signal))


def test_a_cycle_of_delay_fails_times_and_not_magnitudes():
    found = failed(CycleLate(Terminal()), "interruptions", "unbalance")
    assert found == {("interruptions", "time of the start")}
    assert failed(CycleLate(Terminal()), "phasors") == {("synchrophasor (not in rows)", "TVE")}  # beside 50 Hz


class ByZeroCrossings(Instrument):
    """f is that of the last cycle of an interval, from the zero crossings of U1."""

    def read(self, signal, *parts, **how):
        readings = super().read(signal, *parts, **how)
        u = np.concatenate([block.codes[:, 0] for block in self.blocks(signal)]).astype(float)
        rising = np.flatnonzero((u[:-1] < 0) & (u[1:] >= 0))
        at = (rising - u[rising] / (u[rising + 1] - u[rising])) / self.terminal.rate
        for number, row in enumerate(one for one in readings.quality if one["channel"] == "total"):
            row["f"] = 1 / (at[10 * number + 10] - at[10 * number + 9])
        return readings


def test_f_by_zero_crossings_fails_f_beside_interharmonics_only():
    assert failed(ByZeroCrossings(Terminal()), "states") == {("power frequency", "f of 10/12 cycles")}


def test_a_reading_that_is_missing_fails_its_point():
    limit = Limit(1.0, "V", "a test")
    assert not judged("", "", "", "", limit, []).passed
    assert not judged("", "", "", "", limit, [[0.1, np.nan]]).passed
    assert judged("", "", "", "", limit, [[0.1, -0.9]]).passed
