"""Dips, swells, interruptions and rapid changes of known voltages (simulated) and of real recordings."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.metering import SampleBlock
from acqd.metering.quality.detector import EventDetector
from acqd.metering.quality.event import Thresholds
from acqd.metering.quality.reference import Declared, Sliding
from acqd.sources import load_waveform
from tests.metering.quality.disturbed import RATE, blocks, form, voltages


def ended(envelope, *, reference=None, limits=None, phases=3, **how):
    """The events that have ended, in the order of their end."""
    detector = EventDetector(form(phases), reference or Declared(230.0), limits)
    events = [e for block in blocks(voltages(envelope, phases=phases, **how)) for e in detector.feed(block)]
    return [event for event in [*events, *detector.finish()] if event.end is not None]


def during(begin, end, share, only=None):
    return lambda t, k: np.where((t >= begin) & (t < end) & ((only is None) | (k == only)), share, 1.0)


@pytest.mark.parametrize("share", [0.1, 0.4, 0.7, 0.85])
@pytest.mark.parametrize("length", [0.1, 0.5, 1.5])
def test_a_dip_has_its_time_duration_and_residual_voltage(share, length):
    (event,) = ended(during(1.0, 1.0 + length, share))
    assert (event.kind, event.phases, event.flags) == ("dip", (0, 1, 2), frozenset())
    assert event.utc_ns == pytest.approx(1e9, abs=0.02e9)
    assert event.duration == pytest.approx(length, abs=0.01)
    assert event.extreme == pytest.approx(share * 230, abs=0.002 * 230)  # class A: 0.2 % of Udin
    assert event.reference == 230


@pytest.mark.parametrize(("f", "nominal"), [(49.6, 50.0), (50.0, 50.0), (60.02, 60.0)])
@pytest.mark.parametrize(
    ("kind", "shares"), [("dip", (0.08, 0.86)), ("swell", (1.14, 1.6)), ("interruption", (0, 0.03))]
)
def test_durations_are_those_of_the_disturbance_within_half_a_cycle(kind, shares, f, nominal):
    """Whatever the depth, the length, the phases and the instant; class A allows one cycle."""
    random = np.random.default_rng(int(f * 100))
    for cycles in (1.0, 2.0, 2.5, 10.0, 17.3):
        if kind == "interruption" and cycles < 2:
            continue  # no cycle lies wholly in it at every instant
        share, begin, phases = random.uniform(*shares), 0.5 + random.uniform(0, 0.02), int(random.choice((1, 3)))
        envelope = during(begin, begin + cycles / f, share)
        u = voltages(envelope, f=f, seconds=1.2, phases=phases)
        detector = EventDetector(form(phases, nominal), Declared(230.0))
        events = [event for block in blocks(u) for event in detector.feed(block)]
        (event,) = [event for event in events if event.kind == kind and event.end is not None]
        assert abs(event.duration * f - cycles) < 0.5 and abs(event.begin / RATE - begin) * f < 0.5
        assert event.utc_ns * 1e-9 == pytest.approx(begin, abs=0.5 / f)


def test_a_dip_of_ten_cycles_to_one_half_lasts_ten_cycles():
    for begin in np.linspace(1.0, 1.02, 5):
        (event,) = ended(during(begin, begin + 0.2, 0.5), seconds=2.0)
        assert event.duration * 50 == pytest.approx(10, abs=0.4)


def test_a_swell_of_one_phase():
    (event,) = ended(during(1.0, 2.0, 1.2, only=1))
    assert (event.kind, event.phases) == ("swell", (1,))
    assert event.extreme == pytest.approx(276, abs=0.46) and event.duration == pytest.approx(1.0, abs=0.04)


def test_a_dip_lasts_from_the_first_phase_to_the_last():
    (event,) = ended(lambda t, k: during(1 + 0.3 * k, 1.4 + 0.3 * k, 0.8 - 0.1 * k)(t, k))
    assert event.phases == (0, 1, 2) and event.duration == pytest.approx(1.0, abs=0.04)
    assert event.extreme == pytest.approx(0.6 * 230, abs=0.46)


def test_an_interruption_needs_all_phases_and_lies_in_a_dip():
    only_two = ended(lambda t, k: np.where((t > 1) & (t < 2) & (k < 2), 0.0, 1.0))
    assert [event.kind for event in only_two] == ["dip"]
    interruption, dip = ended(lambda t, k: np.where((t > 1 + 0.2 * k) & (t < 2 + 0.2 * k), 0.0, 1.0))
    assert (interruption.kind, dip.kind) == ("interruption", "dip")
    assert interruption.duration == pytest.approx(0.6, abs=0.04)  # last phase gone until first phase back
    assert dip.duration == pytest.approx(1.4, abs=0.04)


def test_hysteresis_keeps_one_dip_from_being_many():
    def around(t, _k):
        return 0.9 + 0.01 * np.sin(2 * np.pi * 5 * t) if t[0] else np.where(t < 1, 1.0, 0.9 + 0.01 * np.sin(31 * t))

    assert len(ended(around, limits=Thresholds(rvc=0))) == 1
    assert len(ended(around, limits=Thresholds(hysteresis=0.0, rvc=0))) > 5


def test_a_rapid_change_has_its_steady_and_its_largest_change():
    (event,) = ended(lambda t, _: np.where(t < 2, 1.0, 0.935 - 0.02 * np.exp(-(t - 2) / 0.05)), seconds=6.0)
    assert event.kind == "rvc" and event.utc_ns == pytest.approx(2e9, abs=0.02e9)
    assert event.steady_change == pytest.approx(0.065 * 230, abs=0.5)
    assert event.steady_change + 1 < event.extreme < 0.09 * 230
    assert event.duration < 0.2


def test_a_dip_is_no_rapid_change_and_a_slow_change_is_nothing():
    assert [event.kind for event in ended(during(2.0, 3.5, 0.8), seconds=6.0)] == ["dip"]
    assert ended(lambda t, _: 1.0 - 0.02 * np.clip(t - 1, 0, 4), seconds=6.0) == []


def test_the_reports_of_begin_and_end_have_one_number():
    detector = EventDetector(form(), Declared(230.0))
    events = [event for block in blocks(voltages(during(1, 2, 0.5))) for event in detector.feed(block)]
    assert [(event.number, event.end is None) for event in events] == [(0, True), (0, False)]
    assert events[0].begin == events[1].begin


def test_a_gap_in_a_dip_ends_it_with_a_flag_and_what_follows_is_another_event():
    u = voltages(during(1.0, 3.0, 0.5))
    detector, events = EventDetector(form(), Declared(230.0)), []
    for block in [*blocks(u[:20_000]), *blocks(u[20_100:], index=20_100)]:
        events += [event for event in detector.feed(block) if event.end is not None]
    assert [(event.kind, event.flags) for event in events] == [("dip", {"gap"}), ("dip", {"gap"})]
    assert events[0].end <= 20_000 and events[1].begin >= 20_100


def test_what_is_cut_by_the_ends_of_the_stream_is_flagged():
    dark = ended(lambda t, _: 0 * t, seconds=1.0)
    assert {event.kind for event in dark} == {"dip", "interruption"}
    assert all(event.flags == {"start", "unfinished"} for event in dark)


def test_a_sliding_reference_follows_slowly_and_not_in_a_dip():
    def sagging(t, _k):
        return np.where((t > 8) & (t < 9), 0.75, 0.85)

    assert [event.kind for event in ended(sagging, seconds=10.0)] == ["dip"]  # declared: all of it
    (event,) = ended(sagging, seconds=10.0, reference=Sliding(3, 50.0))
    assert event.reference == pytest.approx(0.85 * 230, rel=1e-3)
    assert event.utc_ns == pytest.approx(8e9, abs=0.02e9) and event.duration == pytest.approx(1.0, abs=0.04)


def test_flags_of_the_samples_are_flags_of_the_event():
    detector, events = EventDetector(form(), Declared(230.0)), []
    for block in blocks(voltages(during(1.0, 1.5, 0.5))):
        flagged = SampleBlock(block.codes, block.index, block.utc_ns, 0, frozenset({"simulated"}))
        events += detector.feed(flagged)
    assert all("simulated" in event.flags for event in events)


@pytest.mark.parametrize(
    "wrong", [{"dip": 1.1}, {"swell": 0.9}, {"hysteresis": 0.2}, {"interruption": 0.95}, {"rvc": 0.7}, {"dip": 0.0}]
)
def test_impossible_thresholds_are_refused(wrong):
    with pytest.raises(ValueError, match="expected"):
        Thresholds(**wrong)


def test_events_of_a_recorded_compressor_start_agree_with_an_independent_rms(waveforms):
    waveform = load_waveform(waveforms / "fridge_1ph_20k" / "replay_20k_el3783.npz")
    u = waveform.codes[:, 0] * waveform.form.scale[0]
    squares = np.concatenate(([0.0], np.cumsum(u * u)))
    sliding = np.sqrt((squares[400:] - squares[:-400]) / 400)  # of 20 ms, at every sample
    limits = Thresholds(dip=0.985, hysteresis=0.003, rvc=0)
    detector, events = EventDetector(waveform.form, Declared(236.0), limits), []
    for start in range(0, len(u), 800):
        events += detector.feed(SampleBlock(waveform.codes[start : start + 800], start, 0))
    dips = [event for event in events if event.end is not None]
    assert len(dips) == 1 and dips[0].kind == "dip"
    below = np.flatnonzero(sliding < 0.985 * 236)
    assert dips[0].begin == pytest.approx(below[0], abs=400)
    assert dips[0].end - 400 == pytest.approx(
        np.flatnonzero(sliding[below[-1] :] > 0.988 * 236)[0] + below[-1], abs=400
    )
    assert dips[0].extreme == pytest.approx(sliding.min(), rel=1e-3)
