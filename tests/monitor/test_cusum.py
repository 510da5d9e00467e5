"""The sequential test: false alarms as often as asked for, alarms soon after a change, the state outlives a restart."""

import json

import numpy as np
import pytest
from scipy.signal import lfilter

from acqd.monitor.cusum import Baseline, Monitor
from acqd.monitor.thresholds import MONITOR

STEP = 0.04


def residual(random, minutes, *, level=0.0, size=1.0, wander=0.3):
    """Coloured noise on a standby that wanders, as a meter leaves it."""
    rows = round(60 * minutes / STEP)
    noise = lfilter([0.5], [1, -0.7], random.normal(0, 1, rows))
    keep = np.exp(-STEP / 30)
    slow = lfilter([1.0], [1, -keep], wander * np.sqrt(1 - keep**2) * random.normal(0, 1, rows))
    return level + size * noise + slow


def recordings(random, count, **kind):
    """Residuals and predictions of recordings that begin at rest and then move."""
    errors = [residual(random, 1.0, **kind) for _ in range(count)]
    t = np.arange(len(errors[0])) * STEP
    return errors, [100 + 20 * np.sin(t) * (t > 15) for _ in errors]


def baseline(random, hours_between=50.0):
    errors, predicted = recordings(random, 30)
    starts = [60.0 * k for k in range(30)]
    return Baseline.of(errors, predicted, starts, STEP, 3600 * hours_between)


def run(monitor, errors, predicted, start_s=1e6):
    for number, (off, guess) in enumerate(zip(errors, predicted, strict=True)):
        alarm = monitor.update(off, guess, start_s + 60 * number, STEP)
        if alarm is not None:
            return alarm
    return None


def test_it_is_silent_for_hours_when_nothing_changes():
    alarms = 0
    for seed in range(4):
        random = np.random.default_rng(seed)
        alarms += run(Monitor(baseline(random)), *recordings(random, 180)) is not None
    assert alarms <= 1  # 12 h recorded, one false alarm in 50 h was asked for


@pytest.mark.parametrize("change", [{"level": 2.5}, {"level": -2.5}, {"size": 2.0}])
def test_a_change_raises_the_alarm_within_minutes_and_its_onset_is_told(change):
    random = np.random.default_rng(11)
    monitor = Monitor(baseline(random))
    assert run(monitor, *recordings(random, 20), start_s=1e6) is None
    begun = 1e6 + 20 * 60
    alarm = run(monitor, *recordings(random, 20, **change), start_s=begun)
    assert alarm is not None
    assert alarm.raised_s - begun < 300
    assert abs(alarm.onset_s - begun) < 90


def test_it_says_so_once_and_goes_on_where_an_earlier_process_stopped():
    random = np.random.default_rng(5)
    base = baseline(random)
    calm, changed = recordings(random, 3), recordings(random, 10, level=0.8)
    errors, predicted = calm[0] + changed[0], calm[1] + changed[1]
    whole, first, second = Monitor(base), Monitor(base), Monitor(base)
    alarm = run(whole, errors, predicted)
    assert alarm is not None
    assert run(first, errors[:3], predicted[:3]) is None
    second.restore(json.loads(json.dumps(first.as_json())))
    assert run(second, errors[3:], predicted[3:], 1e6 + 180) == alarm
    assert run(second, errors, predicted) is None  # it stays, and is not raised again
    assert second.alarm == alarm


def test_a_single_protective_stop_is_no_change():
    random = np.random.default_rng(6)
    monitor = Monitor(baseline(random))
    errors, predicted = recordings(random, 30)
    errors[7][400:420] += 300.0
    assert run(monitor, errors, predicted) is None


def test_too_few_blocks_make_no_baseline():
    random = np.random.default_rng(7)
    short = [residual(random, MONITOR.cusum_block_s * 3 / 60)]
    assert Baseline.of(short, [np.zeros(len(short[0]))], [0.0], STEP, 3600.0) is None
