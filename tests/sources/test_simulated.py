"""The simulated mains."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import InputError
from acqd.metering import Meter
from acqd.sources import SimulatedSource, SimulationSettings
from acqd.sources.simulated import Sag
from acqd.sources.spec import make_source, simulated_spec


@settings(max_examples=15)
@given(reads=st.lists(st.integers(1, 2_500), min_size=1, max_size=8))
def test_simulated_samples_do_not_depend_on_how_they_are_read(reads):
    one, many = SimulatedSource(), SimulatedSource()
    one.open(0)
    many.open(0)
    parts = [many.read(limit).codes for limit in reads]
    np.testing.assert_array_equal(np.concatenate(parts), one.read(sum(reads)).codes)


def test_simulation_keeps_what_its_settings_promise(tmp_path):
    profile = tmp_path / "p.csv"
    profile.write_text("t,P1\n0,100\n10,100\n")
    sag = Sag(at=1.0, duration=0.5, depth=0.4)
    settings_ = SimulationSettings(
        frequency=49.5, frequency_wander=0.0, voltage=225.0, harmonics={}, current_harmonics={}, dc=0.01,
        load_profile=profile, sags=(sag,), noise=0.0,
    )  # fmt: skip
    source = make_source(simulated_spec(settings_))
    source.open(0)
    block = source.read(60_000)
    assert block.flags == {"simulated"}
    batch = Meter(source.form).feed(block)
    expected = 225.0 * np.sqrt(1 + 2 * 0.01**2 / 2)
    assert batch.Vrms[0, 10] == pytest.approx(expected, rel=3e-4)
    assert batch.P[:, 10] == pytest.approx(100.0, rel=1e-3)
    assert batch.f[10] == pytest.approx(49.5, abs=0.002)
    assert batch.Vrms[0, 30] == pytest.approx(0.6 * 225.0, rel=1e-3)
    assert batch.Vrms[0, 50] == pytest.approx(expected, rel=3e-4)


def test_bad_load_profile_is_named(tmp_path):
    path = tmp_path / "p.csv"
    for text, complaint in (
        ("a,b\n", "header"), ("t,P1\n0,x\n", "row 2"), ("t,P1\n0,1\n0,1\n", "rising"), ("1" * 140_000, "field larger"),
    ):  # fmt: skip
        path.write_text(text)
        with pytest.raises(InputError, match=complaint):
            SimulatedSource(SimulationSettings(load_profile=path))
