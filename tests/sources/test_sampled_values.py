"""IEC 61850-9-2 sampled values on the wire."""

from __future__ import annotations

import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

from acqd.errors import UserError
from acqd.metering import Meter
from acqd.sources.sampled_values import SampledValuesSettings, SampledValuesSource
from acqd.sources.sampled_values.counter import SecondCounter
from tests.doubles.sampled_values import MergingUnitProcess, SvWave
from tests.doubles.veth import may_create_veth, veth_pair
from tests.sources.bench import START_NS, Tape, VirtualClock
from tests.waiting import wait_for

on_wire = pytest.mark.skipif(not may_create_veth(), reason="veth pairs need CAP_NET_ADMIN (root)")


class Rig:
    """A source at a merging unit that sends bursts."""

    def __init__(self, stack: ExitStack, **options: object) -> None:
        self.near, far = stack.enter_context(veth_pair("acqdtst"))
        self.unit = stack.enter_context(MergingUnitProcess(far, clock="burst", **options))
        self.clock, self.tape, self.stack = VirtualClock(), Tape(), stack

    @contextmanager
    def publishing(self) -> Iterator[None]:
        done = threading.Event()

        def publish() -> None:
            while not done.wait(0.005):
                self.unit.burst(12)

        thread = threading.Thread(target=publish)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()

    def start(self, **settings_: object) -> SampledValuesSource:
        """A stream named by svID and APPID is not waited for once it is heard."""
        if settings_.get("svid") == "MU0101":
            settings_["appid"] = 0x4000
        self.source = SampledValuesSource(SampledValuesSettings(self.near, **settings_), self.clock)
        self.stack.callback(self.source.close)
        with self.publishing():
            self.source.connect()
        self.source.open(START_NS)
        return self.source

    def step(self, times: int = 1, frames: int = 24, samples: int = 48) -> None:
        for _ in range(times):
            self.clock.now += round(samples * 1e9 / self.source.form.rate)
            self.unit.burst(frames)
            self.source.exchange()
            while len((block := self.source.read(10_000)).codes):
                self.tape.add(block)


@pytest.fixture
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    with ExitStack() as stack:
        yield Rig(stack, **getattr(request, "param", {"rate": 4800, "asdus": 2}))


def codes_of(rate: int) -> Callable[[int, int], np.ndarray]:
    return SvWave(rate).codes


@on_wire
@pytest.mark.parametrize("rig", [{"rate": 4800, "asdus": 2, "vlan": 5}], indirect=True)
def test_a_vlan_tag_does_not_matter(rig: Rig):
    rig.start(svid="MU0101", rate=4800.0)
    rig.step(50)
    rig.tape.offset(codes_of(4800), 48_000)


@on_wire
@pytest.mark.parametrize("rig", [{"rate": 4800, "asdus": 2, "prp": True}], indirect=True)
def test_the_trailer_of_a_redundant_network_does_not_matter(rig: Rig):
    rig.start(svid="MU0101", rate=4800.0)
    rig.step(20)
    rig.unit.command(duplicate=5)  # from LAN B
    rig.step(20)
    assert rig.tape.lost == 0
    rig.tape.offset(codes_of(4800), 48_000)


@on_wire
def test_copies_and_overtaking_frames_are_put_right(rig: Rig):
    rig.start(svid="MU0101", rate=4800.0)
    rig.step(10)
    for command in ({"duplicate": 5}, {"reorder": True}, {"duplicate": 1}):
        rig.unit.command(**command)
        rig.step(5)
    assert rig.tape.lost == 0 == rig.source.health().lost
    rig.tape.offset(codes_of(4800), 48_000)


@on_wire
@pytest.mark.parametrize("kind", ["cut", "count", "length", "tag"])
def test_a_malformed_frame_is_a_gap_of_its_samples(rig: Rig, kind):
    rig.start(svid="MU0101", rate=4800.0)
    rig.step(10)
    rig.unit.command(malformed=3, kind=kind)
    rig.step(10)
    assert rig.tape.lost == 6
    rig.tape.offset(codes_of(4800), 48_000)


@on_wire
def test_a_changed_data_set_ends_the_stream_with_a_reason(rig: Rig):
    source = rig.start(svid="MU0101", rate=4800.0)
    rig.step(10)
    rig.unit.command(confrev=2)
    rig.step(10)
    assert not source.health().connected and "confRev 2, was 1" in source.health().reason
    rig.unit.command(confrev=1)
    rig.step(1_500)
    assert source.health().connected and source.health().reconnects == 1
    rig.tape.offset(codes_of(4800), 48_000)


@on_wire
@pytest.mark.parametrize("counter", [700, 4000])
def test_a_merging_unit_that_finds_its_time_pulse_costs_no_sample(rig: Rig, counter):
    rig.start(svid="MU0101", rate=4800.0)
    rig.step(2)
    first = rig.tape.offset(codes_of(4800), 48_000)  # how many samples the start took depends on the machine
    while not 0 <= (first + rig.tape.index[-1] + 1) % 4800 - counter < 48:
        rig.step()
    rig.unit.burst(7)
    rig.unit.command(restart=True)  # in the middle of what the next exchange takes
    rig.step(20)
    assert rig.tape.lost == 0 == rig.source.health().lost
    assert rig.tape.flagged("sync_error") and "sync_error" not in rig.tape.blocks[-1].flags
    # The double's samples go on whatever it calls them.
    rig.tape.offset(codes_of(4800), 48_000)


@pytest.mark.parametrize("offset", [-1920, 1920])
def test_a_counter_that_was_set_is_recognised_by_the_arrival_times(offset):
    counter, at = SecondCounter(4800), 0
    counter.unwrap(np.arange(2000, 2048), 0)
    at = round(48e9 / 4800)
    assert not counter.was_set
    counter.unwrap(np.arange(2048 + offset, 2096 + offset) % 4800, at)
    assert counter.was_set
    counter.unwrap(np.arange(2096 + offset, 2144 + offset) % 4800, 2 * at)
    assert not counter.was_set


@on_wire
def test_a_host_clock_that_is_set_forward_invents_no_gap(rig: Rig, monkeypatch):
    rig.start(svid="MU0101", rate=4800.0)
    rig.step(10)
    real = time.time_ns
    monkeypatch.setattr("time.time_ns", lambda: real() + 60 * 10**9)
    rig.step(10)
    assert rig.tape.lost == 0 == rig.source.health().lost
    rig.tape.offset(codes_of(4800), 48_000)


@on_wire
def test_a_card_that_goes_and_comes_back_is_heard_again():
    with ExitStack() as stack:
        rig = Rig(stack, rate=4800, asdus=2)
        source = rig.start(svid="MU0101", rate=4800.0)
        rig.step(10)
        subprocess.run(["ip", "link", "set", rig.near, "down"], check=True)
        for _ in range(80):
            rig.clock.now += 10_000_000
            source.exchange()
        assert not source.health().connected
        subprocess.run(["ip", "link", "set", rig.near, "up"], check=True)
        wait_for(lambda: (rig.step(20), source.health().connected)[1], "the card is heard again")


@on_wire
@pytest.mark.parametrize("rig", [{"rate": 4800, "asdus": 2, "streams": 2}], indirect=True)
def test_of_several_streams_one_must_be_named(rig: Rig):
    with pytest.raises(UserError, match=r"several streams, name one of 'MU0101' .*'MU0101-2'"):
        rig.start(rate=4800.0)
    with pytest.raises(UserError, match="'MU9' is not among the streams"):
        rig.start(svid="MU9", rate=4800.0)
    rig.start(svid="MU0101-2", rate=4800.0)
    rig.step(50)
    rig.tape.offset(SvWave(4800, seed=2).codes, 48_000)


@on_wire
def test_the_rate_is_counted_where_nothing_says_it(rig: Rig):
    rig.unit.command(stop=True)
    assert rig.start(svid="MU0101").form.rate == 4800.0


@on_wire
@pytest.mark.parametrize(
    ("rig", "rate"), [({"rate": 4800, "asdus": 2}, 4000.0), ({"rate": 4000, "asdus": 1}, 4800.0)], indirect=["rig"]
)
def test_a_rate_that_the_frames_contradict_ends_the_stream_with_a_reason(rig: Rig, rate):
    source = rig.start(svid="MU0101", rate=rate)
    for _ in range(300):
        rig.step(1, frames=40, samples=48)
        if not source.health().connected:
            break
    assert "correct source.rate" in source.health().reason


@on_wire
def test_silence_wrong_channels_and_wrong_interfaces_are_named(rig: Rig):
    quiet = SampledValuesSource(SampledValuesSettings(rig.near))
    with pytest.raises(UserError, match="no sampled values on"):
        quiet.connect()
    quiet.close()
    with pytest.raises(UserError, match="position 8 is not among them"):
        rig.start(svid="MU0101", rate=4800.0, channels=(4, 8))
    with pytest.raises(UserError, match="no network interface 'nowhere0'"):
        SampledValuesSource(SampledValuesSettings("nowhere0")).connect()


@on_wire
def test_a_recorded_merging_unit_keeps_its_values(waveforms: Path):
    source = next((waveforms / "merging_unit_3ph" / "source").glob("*"))
    with ExitStack() as stack:
        rig = Rig(stack, recording=str(source), rate=4000, asdus=1)
        rig.start(svid="MU0101", rate=4000.0)
        rig.step(100, frames=40, samples=40)
        batch = Meter(rig.source.form, nominal_voltage=400_000.0)
        rows = [done for block in rig.tape.blocks if (done := batch.feed(block)) is not None]
        reference = np.genfromtxt(waveforms / "merging_unit_3ph" / "ref_40ms.csv", delimiter=",", names=True)
        volts = np.concatenate([done.Vrms[0] for done in rows])[2:]
        expected = reference["U_fix"][reference["phase"] == 1]
        assert np.median(volts) == pytest.approx(np.median(expected), rel=2e-4)
