"""Railways (16 2/3 Hz) and aircraft (400 Hz): rows as those of 50 Hz."""

from __future__ import annotations

import json

import numpy as np
import pytest

from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.other_mains import meter_for, row_window
from acqd.metering.window import WindowBatch
from acqd.sources import ChannelMap, load_waveform
from tests.commands import acqd_here

SCALE = (0.0225, 2.81e-4) * 3
START = 1_700_000_000_000_000_000
ROW = {50 / 3: 0.12, 400.0: 0.04}


def stream(f, seconds, rate=20_000.0):
    """Codes of three phases: 230 V with a fifth harmonic, 4 A that lag by 0.5 rad."""
    angle = 2 * np.pi * f * np.arange(round(seconds * rate))[:, None] / rate - 2 * np.pi / 3 * np.arange(3)
    codes = np.empty((len(angle), 6))
    codes[:, 0::2] = (325.27 * np.cos(angle) + 10 * np.cos(5 * angle)) / SCALE[0]
    codes[:, 1::2] = 4 * np.sqrt(2) * np.cos(angle - 0.5) / SCALE[1]
    return np.rint(codes).astype(np.int16)


def metered(codes, form, size, start=0):
    meter = meter_for(form)
    blocks = (
        SampleBlock(codes[k : k + size], start + k, START + round((start + k) * 1e9 / form.rate))
        for k in range(0, len(codes), size)
    )
    batches = [batch for batch in map(meter.feed, blocks) if batch is not None]
    return WindowBatch.join(batches), meter


@pytest.mark.parametrize("mode", ["synchronous", "fixed"])
@pytest.mark.parametrize(("nominal", "f"), [(50 / 3, 16.5), (50 / 3, 16.7), (400.0, 398.0), (400.0, 403.0)])
def test_values_of_a_row(nominal, f, mode):
    form = StreamFormat(20_000.0, SCALE, nominal)
    codes = stream(f, 3.0)
    meter = meter_for(form, mode=mode)
    batch = meter.feed(SampleBlock(codes, 0, START))
    assert row_window(form) == pytest.approx(ROW[nominal])
    assert len(batch) == int(3.0 / ROW[nominal])
    assert np.diff(batch.utc_ns) == pytest.approx(ROW[nominal] * 1e9, abs=2) and batch.utc_ns[0] == START
    assert batch.seq.tolist() == list(range(len(batch)))
    good = slice(2, None)
    exact = 2e-4 if mode == "synchronous" else 0.02
    Vrms = np.hypot(325.27, 10) / np.sqrt(2)
    assert batch.f[good] == pytest.approx(f, abs=0.01 * f / 50)
    assert batch.Vrms[:, good] == pytest.approx(Vrms, rel=exact)
    assert batch.Irms[:, good] == pytest.approx(4.0, rel=exact)
    P = 325.27 * 4 / np.sqrt(2) * np.cos(0.5)
    assert batch.P[:, good] == pytest.approx(P, rel=2 * exact)
    assert batch.Q1[:, good] == pytest.approx(325.27 * 4 / np.sqrt(2) * np.sin(0.5), rel=1e-3)
    hours = len(batch) * ROW[nominal] / 3600
    assert batch.W[:, -1].mean() == pytest.approx(P * hours / 1000, rel=1e-4)
    assert not any(flags for phase in batch.flags for flags in phase[2:])


@pytest.mark.parametrize("nominal", ROW)
def test_blocks_change_nothing_and_a_gap_is_flagged(nominal):
    form = StreamFormat(20_000.0, SCALE, nominal)
    codes = stream(nominal, 1.5)
    whole, _ = metered(codes, form, len(codes))
    for size in (800, 333):
        parts, _ = metered(codes, form, size)
        assert parts.seq.tolist() == whole.seq.tolist()
        np.testing.assert_allclose(parts.P, whole.P, rtol=1e-4)
        np.testing.assert_allclose(parts.W, whole.W, rtol=1e-9)
    meter = meter_for(form)
    first = meter.feed(SampleBlock(codes[:12_500], 0, START))
    second = meter.feed(SampleBlock(codes[14_000:], 14_000, START + 700_000_000, lost=1_500))
    both = WindowBatch.join([first, second])
    assert any("gap" in flags for flags in both.flags[0])
    at = int(0.9 / ROW[nominal])
    assert both.utc_ns[both.seq == at] == START + round(at * ROW[nominal] * 1e9)


def test_registers_go_on_from_a_reading():
    form = StreamFormat(20_000.0, SCALE, 400.0)
    meter = meter_for(form, energy=[(5.0, 1.0)] * 3, creep_W=1.0)
    meter.feed(SampleBlock(stream(400.0, 0.5), 0, START))
    imported, exported = meter.energy.reading()[0]
    assert 5.0 < imported < 5.001 and exported == 1.0


def write_csv(path, f, rate):
    codes = stream(f, 1.0, rate)
    t = np.arange(len(codes)) / rate
    np.savetxt(path, np.column_stack([t, codes[:, :2] * SCALE[:2]]), "%.6f", ",", header="time,u1,i1", comments="")


@pytest.mark.parametrize(("f", "nominal"), [(16.7, 50 / 3), (400.0, 400.0), (50.0, 50.0), (60.0, 50.0)])
def test_a_file_that_does_not_say_its_mains_is_recognised(tmp_path, f, nominal):
    write_csv(tmp_path / "a.csv", f, 10_000)
    waveform = load_waveform(tmp_path / "a.csv")
    assert waveform.form.f_nominal == pytest.approx(nominal)
    assert load_waveform(tmp_path / "a.csv", ChannelMap(f_nominal=60.0)).form.f_nominal == 60.0


def test_power_quality_of_other_mains_is_refused(tmp_path):
    write_csv(tmp_path / "a.csv", 400.0, 10_000)
    done = acqd_here("replay", "a.csv", "--quality", "q.jsonl", cwd=tmp_path)
    assert done.returncode == 2 and "defined for 50 and 60 Hz" in done.stderr
    (tmp_path / "acqd.toml").write_text('[source]\nkind = "simulated"\nfrequency = 16.7\n[events]\nenabled = true\n')
    done = acqd_here("run", "--config", "acqd.toml", cwd=tmp_path)
    assert done.returncode == 2 and "mains of 16.6667 Hz" in done.stderr


@pytest.mark.parametrize("nominal", [50 / 3, 400.0])
def test_a_meter_goes_on_from_the_state_of_another(nominal):
    form = StreamFormat(20_000.0, SCALE, nominal)
    codes = stream(nominal * 1.002, 2.0)
    cuts = np.array_split(codes, 37)
    starts = np.cumsum([0, *map(len, cuts)])[:-1].tolist()
    blocks = [SampleBlock(cut, k, START + round(k * 1e9 / form.rate)) for cut, k in zip(cuts, starts, strict=True)]
    meter = meter_for(form)
    for block in blocks[:20]:
        meter.feed(block)
    other = meter_for(form)
    other.restore(json.loads(json.dumps(meter.state())))
    whole, again = ([each.feed(block) for block in blocks[20:]] for each in (meter, other))
    for own, same in zip(whole, again, strict=True):
        assert (own is None) == (same is None)
        if own is not None:
            assert np.array_equal(own.Vrms, same.Vrms) and np.array_equal(own.imported, same.imported)
            assert np.array_equal(own.f, same.f) and own.utc_ns.tolist() == same.utc_ns.tolist()
            assert own.flags == same.flags
