"""The line through the clocks of many logs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.dataset.align import Lag
from acqd.dataset.build import BuildConfig, build
from acqd.dataset.clock_line import deviates, fit_line
from acqd.dataset.manifest import load_manifest
from tests.campaigns import quiet


@pytest.mark.slow
def test_one_clock_that_was_set_in_between_is_announced(campaign, tmp_path):
    made, true = campaign
    if made.settings.robot != "iiwa7_r800":
        pytest.skip("one robot is enough")
    logs = tmp_path / "logs"
    logs.mkdir()
    paths = sorted(made.out.rglob("logs/*/*"))
    for path in paths:
        (logs / path.name).write_text(path.read_text())
    lines = (logs / paths[2].name).read_text().splitlines()
    shifted = [lines[0]]
    for line in lines[1:]:
        seconds, ns, rest = line.split(" ", 2)
        ms = int(seconds) * 1000 + int(ns) // 1_000_000 + 200
        shifted.append(f"{ms // 1000} {ms % 1000 * 1_000_000} {rest}")
    (logs / paths[2].name).write_text("\n".join([*shifted, ""]))
    report = build(BuildConfig(str(made.out / "power.sqlite"), logs, tmp_path / "ds", made.settings.robot), quiet)
    assert len(report.notes) == 1 and paths[2].name in report.notes[0] and "was it set?" in report.notes[0]
    entry = next(e for e in load_manifest(tmp_path / "ds")["recordings"] if e["name"] == paths[2].stem)
    expected = true[paths[2].stem] + 0.2
    assert entry["lag_by"] == "own" and entry["lag_s"] == pytest.approx(expected, abs=0.01)


def lags_at(t, lag_s, scatter_s, seed, error_s=0.0075):
    """Credible lags that scatter around `lag_s` [n]."""
    scattered = lag_s + np.random.default_rng(seed).normal(0, scatter_s, len(t))
    return [Lag(float(value), 0.9, 3.0, error_s) for value in scattered]


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10_000), scatter_ms=st.floats(1, 15), hours=st.floats(0.2, 6))
def test_scatter_is_no_drift_and_no_step(seed, scatter_ms, hours):
    t = np.linspace(0, 3600 * hours, 16)
    line = fit_line(t, lags_at(t, 1.0, scatter_ms / 1000, seed, scatter_ms / 1000))
    assert line is not None and not line.steps
    assert np.abs(np.asarray(line.at(t)) - 1.0).max() < 2.5 * scatter_ms / 1000


def test_a_drift_that_the_lags_ask_for_is_fitted():
    t = np.linspace(0, 7200, 12)
    line = fit_line(t, lags_at(t, 1.0 + 40e-6 * t, 0.002, 3, 0.002))
    assert line is not None and not line.steps
    assert line.drift_ppm == pytest.approx(40, abs=3 * line.drift_error_ppm + 1e-3) and line.drift_error_ppm < 2


@settings(max_examples=12, deadline=None)
@given(size_ms=st.floats(40, 300), sign=st.sampled_from([-1, 1]), at=st.integers(3, 13), drift=st.floats(-60, 60))
def test_a_step_of_the_clock_is_found_beside_a_drift(size_ms, sign, at, drift):
    t = np.linspace(0, 3600, 16)
    size_s = sign * size_ms / 1000
    line = fit_line(t, lags_at(t, drift * 1e-6 * t + size_s * (np.arange(16) >= at), 0.001, at, 0.001))
    assert line is not None and line.steps
    step, *others = sorted(line.steps, key=lambda each: -abs(each.seconds))
    assert step.before == at and step.after == at - 1 and step.time_s == t[at]
    assert step.seconds == pytest.approx(size_s, abs=0.006)
    assert all(abs(other.seconds) < 0.006 for other in others), "a small drift may be taken for a small step"


def test_one_lag_beside_the_line_is_no_step_and_deviates():
    t = np.linspace(0, 3600, 12)
    lags = lags_at(t, 0 * t, 0.001, 5, 0.001)
    lags[6] = Lag(0.06, 0.9, 3.0, 0.001)
    line = fit_line(t, lags)
    assert line is not None and not line.steps
    assert [k for k in range(12) if deviates(line, t[k], lags[k])] == [6]


def test_lags_all_over_the_place_have_no_common_line():
    t = np.linspace(0, 3600, 12)
    lags = lags_at(t, 0 * t, 0.3, 7, 0.001)
    assert fit_line(t, lags) is None
