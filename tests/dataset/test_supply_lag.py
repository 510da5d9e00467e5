"""The supply's lag, the lags of all recordings together, and recordings that are judged by the others."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.dataset.align import Lag
from acqd.dataset.left_out import Judge
from acqd.dataset.placement import place
from acqd.dataset.supply_lag import USUAL_LAG_S, supply_lag
from tests.dataset.motion import power_of, robot

_COUNT = 6
LAGS_S = 0.3 + np.array([0.0, 0.0004, 0.0009, 0.0013, 0.0016, 0.0021])


def silent(share):
    assert 0 <= share <= 1


@pytest.mark.parametrize(("lag_s", "delay_s"), [(0.0, 0.0), (0.033, 0.0), (0.06, 0.0), (0.0, 0.04)])
def test_lags_are_unbiased_behind_any_supply(lag_s, delay_s):
    recordings = robot(_COUNT, 1)
    power = power_of(recordings, LAGS_S, lag_s, 2, delay_s=delay_s)
    found = place(recordings, power, 1.0, silent)
    assert found.supply_lag_s == pytest.approx(lag_s, abs=0.006)
    for placement, true in zip(found.placements, LAGS_S - delay_s, strict=True):
        assert placement.lag_s == pytest.approx(true, abs=0.006)
        assert placement.method == "clock line" and abs(placement.lag_s - true) < placement.within_s


def test_one_recording_says_that_its_supply_is_unknown():
    recordings = robot(1, 3)
    found = place(recordings, power_of(recordings, [0.3], 0.0, 4), 1.0, silent)
    assert found.supply_lag_s == USUAL_LAG_S
    assert found.placements[0].within_s > 0.015
    assert any("uncertain" in note for note in [*found.notes, found.placements[0].note])
    assert abs(found.placements[0].lag_s - 0.3) < found.placements[0].within_s


def test_a_step_of_the_clock_is_announced_and_not_taken_for_drift():
    recordings = robot(8, 5, seconds=25.0)
    true = 0.3 + 0.06 * (np.arange(8) >= 4)
    names = [f"program_{k}" for k in range(8)]
    found = place(recordings, power_of(recordings, true, 0.015, 6), 1.0, silent, names)
    assert [note for note in found.notes if "was set by +60 ms between program_3 and program_4" in note]
    assert np.abs([p.lag_s - t for p, t in zip(found.placements, true, strict=True)]).max() < 0.006


def judge_of(recordings, power, lags_s, sources):
    lags = [Lag(lag, 0.9, 3.0) for lag in lags_s]
    return Judge(recordings, power, supply_lag(recordings, power, lags, silent), sources)


def test_a_recording_at_a_wrong_lag_is_put_right_by_the_others():
    recordings = robot(_COUNT, 7)
    power = power_of(recordings, LAGS_S, USUAL_LAG_S, 8)
    begun = LAGS_S.copy()
    begun[2] += 0.12
    judge = judge_of(recordings, power, begun, [str(k) for k in range(_COUNT)])
    judgement = judge.lag(2, float(begun[2]))
    assert judgement.lag_s == pytest.approx(LAGS_S[2], abs=0.006)
    assert judgement.credible and judgement.error_s < 0.003


def test_a_pair_of_the_same_programme_does_not_confirm_each_other():
    """Two recordings, whose power is another robot's, explain each other but not the third."""
    recordings, lags_s = robot(3, 9), LAGS_S[:3]
    power = power_of(recordings, lags_s, USUAL_LAG_S, 10)
    other = power_of(recordings, lags_s, USUAL_LAG_S, 11)
    strange = power.time_ns * 1e-9 > recordings[1].t[0] - 1
    power.P[strange] = other.P[strange]
    apart = judge_of(recordings, power, lags_s, ["a", "b", "c"])
    together = judge_of(recordings, power, lags_s, ["a", "twins", "twins"])
    for k in (1, 2):
        assert apart.at(k, lags_s[k]).r2 > 0.8 and together.at(k, lags_s[k]).r2 < 0.2


def test_logs_on_no_common_clock_are_placed_one_by_one_or_refused_with_a_reason():
    """Every log has a clock of its own, and the power of one is missing: it is a replay of another motion."""
    recordings = robot(8, 12, seconds=30.0)
    true = np.random.default_rng(13).uniform(-1, 1, 8)
    power = power_of(recordings, true, 0.015, 14)
    stranger = robot(8, 15, seconds=30.0)[5]
    recordings[5] = stranger
    found = place(recordings, power, 1.5, silent)
    assert found.line is None
    for k, placement in enumerate(found.placements):
        if k == 5:
            assert placement.method == "refused" and placement.note
        else:
            assert placement.method == "own" and placement.lag_s == pytest.approx(true[k], abs=0.008)


def means(power, rows, late_rows=0):
    """The stream of a meter that writes means over `rows` rows, stamped `late_rows` rows behind their middle."""
    kernel = np.ones(rows) / rows
    smooth = np.convolve(np.pad(power.P, rows // 2, mode="edge"), kernel, mode="valid")[: len(power.P)]
    return replace(power, P=np.roll(smooth, late_rows))


@pytest.mark.parametrize("late_rows", [0, 1])
def test_a_mean_over_three_rows_is_not_taken_for_a_slow_supply(late_rows):
    recordings = robot(3, 31, seconds=15.0)
    power = power_of(recordings, LAGS_S[:3], USUAL_LAG_S, 22, noise_W=0.5)
    found = place(recordings, means(power, 3, late_rows), 1.0, silent)
    assert any("were a mean over" in note for note in found.notes)
    for placement, true in zip(found.placements, LAGS_S, strict=False):
        assert abs(placement.lag_s - true) < placement.within_s


@pytest.mark.parametrize("late_rows", [0, 5])
def test_a_mean_over_many_rows_is_known_and_its_stamps_are_doubted(late_rows):
    recordings = robot(4, 21, seconds=15.0)
    power = power_of(recordings, LAGS_S[:4], USUAL_LAG_S, 22, noise_W=0.3)
    found = place(recordings, means(power, 11, late_rows), 1.0, silent)
    assert any("were a mean over" in note and "--lag" in note for note in found.notes)
    for placement, true in zip(found.placements, LAGS_S, strict=False):
        middle = true - 0.04 * late_rows
        assert placement.lag_s == pytest.approx(middle, abs=0.05)
        assert abs(placement.lag_s - true) < placement.within_s < 0.4
