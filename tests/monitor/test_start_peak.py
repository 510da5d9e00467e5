"""Peaks at the start of recordings: an alarm for what acts once per recording, none for hours without a change."""

import json

import numpy as np
import pytest

from acqd.monitor.cusum import CHARTS, Baseline, Monitor
from acqd.monitor.start_peak import StartPeaks, start_peak
from acqd.monitor.thresholds import MONITOR
from tests.monitor.test_cusum import STEP, baseline, run

MINUTE = round(60 / STEP)


def short_starts(random, count, surge_W=0.0):
    """Residuals and predictions of recordings that rest for 1 s, and in which the brakes open after 0.6 s."""
    t = np.arange(MINUTE) * STEP
    surge = surge_W * np.exp(-(t - 0.6) / 0.12) * (t >= 0.6)
    errors = [random.normal(0, 1, MINUTE) + surge for _ in range(count)]
    return errors, [100 + 20 * np.sin(t) * (t > 1) for _ in errors]


def monitor(random):
    errors, predicted = short_starts(random, 40)
    return Monitor(Baseline.of(errors, predicted, [60.0 * k for k in range(len(errors))], STEP, 3600 * 200.0))


def test_a_surge_once_per_recording_raises_the_alarm_of_starts():
    random = np.random.default_rng(1)
    watch = monitor(random)
    assert run(watch, *short_starts(random, 60)) is None
    alarm = run(watch, *short_starts(random, 12, surge_W=6.0), start_s=2e6)
    assert alarm is not None and alarm.chart == "peak at the start up"
    assert alarm.onset_s == 2e6


def test_the_charts_of_blocks_do_not_see_that_surge():
    """The reason for the chart: without it, the test above fails."""
    random = np.random.default_rng(1)
    watch = monitor(random)
    run(watch, *short_starts(random, 60))
    assert run(watch, *short_starts(random, 12, surge_W=6.0), start_s=2e6) is not None
    assert max(watch.sums[:4] / watch.baseline.bounds) < 0.5


def test_pieces_cut_out_of_a_motion_have_no_start():
    t = np.arange(MINUTE) * STEP
    assert start_peak(np.ones(MINUTE), 100 + 20 * np.sin(t), STEP) is None  # moves from the first row
    assert start_peak(np.ones(MINUTE), np.full(MINUTE, 100.0), STEP) is None  # rests throughout
    assert start_peak(np.ones(20), np.full(20, 100.0), STEP) is None  # shorter than a block
    assert start_peak(np.full(MINUTE, 3.0), 100 + 20 * np.sin(t) * (t > 1), STEP) == pytest.approx(np.log(3.0))


def test_false_alarms_are_rarer_than_promised_with_few_recordings():
    """A dozen values leave mean and deviation uncertain; the confidence limits stand for that."""
    random = np.random.default_rng(2)
    between, alarms = 15_000, 0
    for _ in range(40):
        base = StartPeaks.of(list(random.normal(0, 0.2, 12)), between / 12)
        total = 0.0
        for peak in random.normal(0, 0.2, between):
            total = max(0.0, total + base.charted(float(peak)) - MONITOR.cusum_slack)
            if total > base.bound:
                alarms, total = alarms + 1, 0.0
    assert alarms <= 40  # 40 times the period in which one is allowed


def test_too_few_starts_have_no_chart():
    assert StartPeaks.of([0.0] * (MONITOR.cusum_fewest_blocks - 1), 100.0) is None


@pytest.mark.parametrize("charts", [4, 5])
def test_the_state_of_a_version_with_fewer_charts_is_continued(charts):
    watch = Monitor(baseline(np.random.default_rng(3)))
    old = watch.as_json()
    old["sums"], old["since"] = [1.0, 0.0, 2.0, 0.0, 3.0][:charts], [[[5.0, 1.0]], [], [[5.0, 2.0]], [], []][:charts]
    watch.restore(json.loads(json.dumps(old)))
    assert watch.sums[:charts].tolist() == old["sums"] and watch.sums[charts:].tolist() == [0.0] * (12 - charts)
    assert len(watch.since) == len(CHARTS) == 12
