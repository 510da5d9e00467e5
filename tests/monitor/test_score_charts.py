"""Charts of high power, low power and tool: an alarm for what acts in few rows, none for hours without a change."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.models.segments import Segment
from acqd.monitor.blocks import blocks_of
from acqd.monitor.cusum import Baseline, Monitor
from acqd.monitor.score_charts import ScoreCharts
from tests.monitor.test_cusum import STEP, residual

MINUTE = round(60 / STEP)
BETWEEN_S = 3600 * 200.0


def recordings(random, count, start_s=1e6):
    """Segments of a minute in motion, with peaks of power and a tool, their predictions and residuals."""
    t = np.arange(MINUTE) * STEP
    found = []
    for number in range(count):
        phase = random.uniform(0, 6, 2)
        wave = np.sin(t + phase[0]) + np.sin(2.7 * t + phase[1])
        tool = (np.sin(t / 3 + phase[0]) > 0) * 1.0
        segment = Segment("r", "r", "r", "train", np.zeros((MINUTE, 6)), wave, None, {"tool": tool},
                          start_s + 60 * number)  # fmt: skip
        found.append((segment, 100 + 20 * wave + 8 * np.maximum(wave, 1.2) ** 3, residual(random, 1.0)))
    return found


@pytest.fixture(scope="module")
def baseline():
    parts = recordings(np.random.default_rng(0), 40)
    segments, predicted, errors = map(list, zip(*parts, strict=True))
    starts = [segment.start_s for segment in segments]
    base = Baseline.of(errors, predicted, starts, STEP, BETWEEN_S)
    whole = zip(errors, predicted, starts, strict=True)
    blocks = [blocks_of(base.whitener, residual, guess, start, STEP) for residual, guess, start in whole]
    return base, ScoreCharts.of(base.whitener, segments, errors, predicted, blocks, BETWEEN_S)


def run(baseline, parts, *, scores=True):
    base, charts = baseline
    monitor = Monitor(replace(base, start=None, scores=charts if scores else None))
    for segment, predicted, errors in parts:
        alarm = monitor.update(errors, predicted, segment.start_s, STEP, segment)
        if alarm is not None:
            return alarm
    return None


def test_it_is_silent_for_hours_when_nothing_changes(baseline):
    assert sum(run(baseline, recordings(np.random.default_rng(seed), 180)) is not None for seed in range(1, 5)) <= 1


def changed(kind, seed=9):
    parts = []
    for segment, predicted, errors in recordings(np.random.default_rng(seed), 20, 2e6):
        high, low = np.percentile(predicted, [92, 8])
        more = {
            "saturation": -0.035 * np.maximum(predicted - high, 0),
            "clipping": -0.12 * np.minimum(predicted - low, 0),
            "tool": 1.5 * segment.signals["tool"],
        }[kind]
        parts.append((segment, predicted, errors + more))
    return parts


@pytest.mark.parametrize(
    ("kind", "chart"),
    [
        ("saturation", "residual at high power down"),
        ("clipping", "residual at low power down"),
        ("tool", "power of the tool up"),
    ],
)
def test_what_acts_in_few_rows_raises_the_alarm_that_names_it(baseline, kind, chart):
    alarm = run(baseline, changed(kind))
    assert alarm is not None and alarm.chart == chart and alarm.joint is None


@pytest.mark.parametrize("kind", ["saturation", "clipping"])
def test_the_charts_of_whole_blocks_do_not_see_it(baseline, kind):
    """The reason for these charts."""
    assert run(baseline, changed(kind), scores=False) is None
