"""A meter that takes the state of another one goes on as that one would, to the last bit."""

import json
from pathlib import Path

import numpy as np
import pytest

from acqd.metering import Meter, SampleBlock, StreamFormat, WindowBatch
from acqd.metering.bent import Bent
from acqd.metering.correction import ChannelErrors, Correction
from acqd.metering.joined import joined
from acqd.metering.kernel import why_not
from acqd.metering.stages import Stages
from acqd.metering.wiring import Aron
from acqd.sources.load import load_waveform

RATE = 20_000.0
FORM = StreamFormat(RATE, (0.02, 0.0003) * 3)
WAVEFORMS = Path(__file__).parents[3] / "shared/data/waveforms"


def disturbed(seconds: float = 3.0) -> np.ndarray:
    """Codes of three phases: noise, a phase jump, an interharmonic, a dip to nothing, a frequency that wanders."""
    t = np.arange(int(seconds * RATE)) / RATE
    rng = np.random.default_rng(3)
    phase = 2 * np.pi * (50 * t + 0.02 * np.sin(2 * np.pi * 0.7 * t)) + 0.5 * (t > 0.8)
    codes = np.empty((len(t), 6), np.int16)
    for k in range(3):
        u = 325 * np.sin(phase - k * 2 * np.pi / 3) * np.where((t > 1.6) & (t < 1.9), 0.0, 1.0)
        u += 6 * np.sin(2 * np.pi * 57 * t) * (t > 2.2)
        codes[:, 2 * k] = np.rint(u / 0.02 + rng.normal(0, 2, len(t)))
        codes[:, 2 * k + 1] = np.rint(3 * np.sin(phase - k * 2 * np.pi / 3 - 0.4) / 0.0003 + rng.normal(0, 5, len(t)))
    return codes


def blocks_of(codes: np.ndarray, seed: int = 5) -> list[SampleBlock]:
    """Blocks as MAIN_SLOW gets them: mostly windows, some ragged, a gap, a clock step, flags."""
    rng, blocks, at, lost, utc = np.random.default_rng(seed), [], 0, 0, 1_700_000_000_000_000_000
    while at < len(codes):
        count = int(rng.choice((800, 800, 800, 800, 200, 799, 1700)))
        flags = frozenset({"late"}) if len(blocks) % 17 == 3 else frozenset()
        if len(blocks) % 23 == 11:
            flags, utc = flags | {"clock_step"}, utc + 123_456_789
        blocks.append(SampleBlock(codes[at : at + count], at + 400, utc + at * 50_000, lost, flags))
        lost = 333 if len(blocks) % 29 == 20 else 0
        at += count + lost
    return blocks


def columns(batches: list) -> list:
    """What rows are made of, comparable: NaN equals NaN."""
    return [
        [getattr(b, name).tobytes() for name in ("seq", "utc_ns", "Vrms", "Irms", "P", "f", "imported", "exported")]
        + [b.flags]
        for b in batches
        if b is not None
    ]


def check_everywhere(form: StreamFormat, blocks: list[SampleBlock], makers=(), **settings) -> None:
    """States taken between blocks, many of them, each read from JSON by a fresh meter."""
    stages, meter = Stages(form, makers), Meter(Stages(form, makers).form, **settings)
    taken, made = [], []
    for block in blocks:
        taken.append(json.dumps([stages.state(), meter.state()]) if len(taken) % 7 == 0 else "")
        ready = stages.apply(block)
        made.append(None if ready is None else meter.feed(ready))
    assert any(made)
    for at in range(0, len(blocks), 7):
        stages, other = Stages(form, makers), Meter(Stages(form, makers).form, **settings)
        before, state = json.loads(taken[at])
        stages.restore(before)
        other.restore(state)
        ready = [stages.apply(block) for block in blocks[at : at + 12]]
        assert columns([None if b is None else other.feed(b) for b in ready]) == columns(made[at : at + 12]), at


@pytest.mark.parametrize("compiled", [True, False])
def test_a_meter_goes_on_from_the_state_of_another(compiled):
    check_everywhere(FORM, blocks_of(disturbed()), compiled=compiled, energy=[(1.5, 0.25)] * 3, creep_W=0.5)


@pytest.mark.parametrize(("bits", "mode"), [(16, "synchronous"), (64, "synchronous"), (16, "fixed")])
def test_the_cuts_of_the_stream_change_no_bit_of_rows_and_state(bits, mode):
    if why_not() is not None:
        pytest.skip("numpy meters windows together")
    form, codes = StreamFormat(RATE, FORM.scale, bits=bits), disturbed()
    blocks = blocks_of(codes.astype(np.float64) if bits == 64 else codes)
    found = []
    for samples in (1, 5_000, 100_000):
        meter = Meter(form, mode=mode)
        assert meter.indifferent
        made = [batch for block in joined(blocks, samples) if (batch := meter.feed(block)) is not None]
        found.append((columns([WindowBatch.join(made)]), meter.state()))
    assert len(list(joined(blocks, 5_000))) < len(blocks) / 2
    assert found[0] == found[1] == found[2]


def test_with_a_correction_that_interpolates_and_with_derived_phases():
    form, codes = StreamFormat(RATE, (0.02, 0.0003) * 2), disturbed(1.2)[:, :4]
    errors = ChannelErrors((1.0, -1.01) * 2, (0.1, 0.0) * 2, (0.0, 35e-6) * 2)
    check_everywhere(form, blocks_of(codes), [lambda f: Correction(f, errors), Aron])


def test_fixed_windows_of_wide_codes():
    form = StreamFormat(RATE, (0.002, 0.00003) * 3, bits=32)
    check_everywhere(form, blocks_of(disturbed(1.0).astype(np.int32) * 10), mode="fixed")


@pytest.mark.parametrize("name", ["fridge_1ph_20k", "generator_3ph"])
def test_recordings_of_real_mains(name):
    path = WAVEFORMS / name / "replay_20k_el3783.npz"
    if not path.exists():
        pytest.skip("the shared recordings are not here")
    waveform = load_waveform(path)
    check_everywhere(waveform.form, blocks_of(waveform.codes[: 4 * 20_000]))


def test_what_is_no_state_is_refused():
    with pytest.raises(ValueError, match="no state of a meter"):
        Meter(FORM).restore({"stream": {}})
    with pytest.raises(ValueError, match="shorter"):
        Stages(FORM, [lambda f: Correction(f, ChannelErrors((1.0,) * 6, (0.0,) * 6, (0.0,) * 6))]).restore([])


def test_the_usual_bend_of_an_earlier_acqd_was_in_radians_and_is_not_taken_for_hertz():
    seen = Bent()
    for _ in range(30):
        seen.note(0.004, 0.003)
    again = Bent()
    again.restore(seen.state())
    assert again.state() == seen.state()
    again = Bent()
    again.restore({"usual": 3e-4, "known": 25})
    assert again.state() == Bent().state()
