"""The oscilloscope's window: traces, frequency and harmonics."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.daemon.health.section import HealthSection
from acqd.telemetry.broker import free_port
from acqd.web.scope import Scope, ScopeError, analysed


def window(rate, seconds, f, shares, offset=0.0):
    """A window as /window serves it, with 230 V, 2 A and the given harmonics of the current."""
    t = np.arange(round(rate * seconds)) / rate
    u = 230 * np.sqrt(2) * np.sin(2 * np.pi * f * t + 0.4)
    i = (
        2
        * np.sqrt(2)
        * (np.sin(2 * np.pi * f * t) + sum(a * np.sin(2 * np.pi * n * f * t + n) for n, a in shares.items()))
    )
    codes = [np.round(u / 0.02).astype(int).tolist(), np.round((i + offset) / 0.0003).astype(int).tolist()]
    named = {"device": "press", "seq": 7, "time": "", "filetime": 1, "flags": []}
    return named | {"rate": rate, "f_nominal": 50.0, "channels": ["U1", "I1"], "scale": [0.02, 0.0003], "codes": codes}


@pytest.mark.parametrize(("rate", "seconds", "f"), [(20_000, 0.04, 49.7), (20_000, 0.05, 60.2), (4_800, 0.04, 50.3)])
def test_harmonics_are_those_of_the_signal_though_the_window_is_no_whole_number_of_cycles(rate, seconds, f):
    shares = {3: 0.15, 5: 0.08, 31: 0.02}
    picture = analysed(window(rate, seconds, f, shares, offset=0.1))
    current, voltage = picture["figures"]["I1"], picture["figures"]["U1"]
    assert picture["f"] == pytest.approx(f, abs=0.02) and voltage["fundamental"] == pytest.approx(230, rel=1e-3)
    assert current["thd"] == pytest.approx(100 * np.sqrt(sum(a * a for a in shares.values())), abs=0.3)
    for order, share in shares.items():
        assert current["percent"][order - 2] == pytest.approx(100 * share, abs=0.2)
    assert len(current["percent"]) == 39 and voltage["thd"] < 0.3
    assert len(picture["ms"]) == len(picture["traces"]["U1"]) <= 500


def test_a_dead_mains_has_a_trace_and_no_harmonics():
    dead = window(20_000, 0.04, 50.0, {})
    dead["codes"] = [[0] * 800, [1, -1] * 400]
    picture = analysed(dead)
    assert picture["f"] is None and picture["figures"]["I1"]["percent"] == [] and picture["figures"]["U1"]["rms"] == 0


def test_without_a_daemon_there_is_one_line():
    with pytest.raises(ScopeError, match="no answer at"):
        Scope(HealthSection(port=free_port())).picture("press")
    with pytest.raises(ScopeError, match="port is 0"):
        Scope(HealthSection(port=0)).picture("press")
