"""Frames of sampled values: parsed, decoded, damaged."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.sources.sampled_values.decode import CLOCK_UNLOCKED, INVALID, OVERRANGE, SIMULATED, Decoder, names
from acqd.sources.sampled_values.frame import FrameError, parse
from tests.doubles.sampled_values import SvStream, SvWave

CHANNELS = (4, 0, 5, 1, 6, 2)


@pytest.mark.parametrize(("rate", "asdus"), [(4000, 1), (4800, 2), (12_800, 8), (14_400, 6)])
@pytest.mark.parametrize("options", [{}, {"dat_set": "DS1", "refr_tm": True, "smp_rate": True}, {"long_lengths": 2}])
def test_frames_of_every_make_up_decode_to_the_values_sent(rate, asdus, options):
    if options.get("smp_rate"):
        options = options | {"smp_rate": rate}
    stream = SvStream(rate, asdus, **options)
    template = stream.frame(0)
    layout = parse(template)
    assert layout.svid == "MU0101" and layout.appid == 0x4000 and len(layout.asdus) == asdus
    numbers = range(rate // asdus - 3, rate // asdus + 3)  # across the wrap of smpCnt
    frames = np.array([np.frombuffer(stream.frame(k), np.uint8) for k in numbers])
    decoder = Decoder(layout, template, CHANNELS)
    assert decoder.matching(frames).all()
    samples = decoder.decode(frames)
    first = numbers[0] * asdus
    np.testing.assert_array_equal(samples.codes, SvWave(rate).codes(first, 6 * asdus))
    np.testing.assert_array_equal(samples.counter, (first + np.arange(6 * asdus)) % rate)
    assert not samples.flags.any()


@pytest.mark.parametrize(
    ("change", "flag"),
    [
        (lambda stream: stream.set_quality(1, 0), INVALID),
        (lambda stream: stream.set_quality(2, 0), INVALID),  # the other coding of "invalid"
        (lambda stream: stream.set_quality(4, 4), OVERRANGE),
        (lambda stream: setattr(stream, "smp_synch", 0), CLOCK_UNLOCKED),
        (lambda stream: setattr(stream, "simulate", True), SIMULATED),
    ],
)
def test_quality_synchronisation_and_simulation_become_flags(change, flag):
    stream = SvStream()
    template = stream.frame(0)
    change(stream)
    frame = np.frombuffer(stream.frame(1), np.uint8)[None]
    decoder = Decoder(parse(template), template, CHANNELS)
    assert decoder.matching(frame).all() and set(decoder.decode(frame).flags.tolist()) == {flag}
    assert names(flag)


def test_the_quality_of_an_unused_neutral_does_not_matter():
    stream = SvStream()
    template = stream.frame(0)
    stream.set_quality(1, 3)
    frame = np.frombuffer(stream.frame(1), np.uint8)[None]
    assert not Decoder(parse(template), template, CHANNELS).decode(frame).flags.any()


@settings(max_examples=100)
@given(st.data())
def test_damaged_frames_raise_one_kind_of_error_or_none_never_another(data):
    frame = bytearray(SvStream(4800, 2, dat_set="DS", long_lengths=1).frame(3))
    for _ in range(data.draw(st.integers(0, 6))):
        frame[data.draw(st.integers(12, len(frame) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(frame)))
    try:
        layout = parse(bytes(frame[:cut]))
    except FrameError as error:
        assert "\n" not in str(error)
    else:
        for asdu in layout.asdus:
            assert asdu.samples + 8 * asdu.values <= cut
