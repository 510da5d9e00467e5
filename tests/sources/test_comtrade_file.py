"""COMTRADE files (IEEE C37.111)."""

from __future__ import annotations

import pytest

from acqd.errors import InputError
from acqd.sources import load_waveform


def test_comtrade_without_phase_letters(waveforms):
    waveform = load_waveform(waveforms / "ion7650_3ph_60hz" / "source" / "keating_1999.CFG")
    assert waveform.form.phases == 3 and waveform.form.f_nominal == 60.0
    assert waveform.form.rate == pytest.approx(30_707.24, abs=0.01)


def test_truncated_comtrade_is_noticed(tmp_path, waveforms):
    source = waveforms / "generator_3ph" / "source"
    (tmp_path / "test3.cfg").write_bytes((source / "test3.cfg").read_bytes())
    (tmp_path / "test3.dat").write_bytes((source / "test3.dat").read_bytes()[:900_000])
    with pytest.raises(InputError, match="truncated"):
        load_waveform(tmp_path / "test3.cfg")
