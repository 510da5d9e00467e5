"""A TwinCAT PC: what the ring's reader makes of a PLC that stops, changes, stays silent or has no ring."""

from __future__ import annotations

import struct
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from acqd.errors import UserError
from acqd.sources.ads import AdsSettings, AdsSource
from acqd.sources.ads.ring import HEAD_BYTES, RingError, parse_head, read_slots
from tests.doubles.ads import AdsDouble, Settings, unused_host
from tests.sources.bench import START_NS, Tape, VirtualClock


class Rig:
    def __init__(self, **settings: object) -> None:
        self.double = AdsDouble(Settings(host=unused_host(), clock="lockstep", **settings))  # type: ignore[arg-type]
        self.settings = AdsSettings(self.double.settings.host, self.double.settings.net_id)
        self.clock, self.tape = VirtualClock(), Tape()
        self.source = AdsSource(self.settings, self.clock)

    def start(self) -> None:
        self.source.connect()
        self.source.open(START_NS)

    def step(self, times: int = 1) -> None:
        for _ in range(times):
            self.clock.now += 20_000_000
            self.source.exchange()
            while len((block := self.source.read(10_000)).codes):
                self.tape.add(block)


@pytest.fixture
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    made = Rig(**getattr(request, "param", {}))
    with made.double:
        yield made
        made.source.close()


@pytest.mark.parametrize("rig", [{"frames": 100, "phases": 1, "advance": 4}], indirect=True)
def test_the_head_says_what_a_slot_holds(rig: Rig):
    rig.start()
    rig.step(50)
    assert rig.source.form.phases == 1 and rig.source.form.rate == 20_000.0 and rig.tape.lost == 0
    rig.tape.offset(rig.double.wave.codes, 60_000)


def test_a_slot_that_is_being_written_is_read_later_not_half(rig: Rig):
    rig.start()
    rig.step(10)
    for _ in range(5):
        rig.double.command(tear=True)
        rig.step(2)
    assert rig.tape.lost == 0
    rig.tape.offset(rig.double.wave.codes, 60_000)


def test_a_stopped_plc_is_named_and_waited_for(rig: Rig):
    rig.start()
    rig.step(10)
    rig.double.command(state=6)
    rig.step(40)
    assert not rig.source.health().connected and "STOP" in rig.source.health().reason
    rig.double.command(state=5)
    rig.step(500)
    assert rig.source.health().connected and rig.source.health().reconnects == 1


def test_a_ring_that_stands_still_is_named(rig: Rig):
    rig.start()
    rig.step(10)
    rig.double.command(freeze=True)
    rig.step(40)
    assert "stands still" in rig.source.health().reason


def test_a_changed_range_makes_the_samples_invalid(rig: Rig):
    rig.start()
    rig.step(10)
    rig.double.command(range=1)
    rig.step(3)
    assert "invalid" in rig.tape.blocks[-1].flags and "range" in rig.source.health().reason


def test_the_1_a_range_has_a_fifth_of_the_scale(rig: Rig):
    rig.double.command(range=0b001)
    rig.start()
    volts, *_ = rig.source.form.scale
    assert rig.source.form.scale[1] == pytest.approx(rig.source.form.scale[3] / 5)
    rig.step(5)
    assert volts == pytest.approx(737.2575 / 32768) and not rig.tape.blocks[-1].flags


def test_slots_that_are_never_whole_are_no_silent_success(rig: Rig):
    rig.start()
    rig.step(5)
    for _ in range(40):
        rig.double.command(skip_slots=40)
        rig.step()
    assert not rig.source.health().connected and "no whole samples" in rig.source.health().reason


def test_a_silent_plc_costs_one_time_out_and_is_called_again(rig: Rig):
    rig.start()
    rig.step(5)
    rig.double.command(silent=True)
    rig.step(1)
    assert not rig.source.health().connected and rig.source.health().reason
    rig.double.command(silent=False)
    rig.step(400)
    assert rig.source.health().connected


def test_a_plc_without_the_ring_is_told_what_to_add(rig: Rig):
    rig.double.command(remove_ring=True)
    with pytest.raises(UserError, match="docs/twincat"):
        rig.start()


def test_nobody_there_is_one_clear_line():
    host = unused_host()
    source = AdsSource(AdsSettings(host, f"{host}.1.1"))
    with pytest.raises(UserError, match=r"does not answer .* is the TwinCAT PC on"):
        source.connect()


@pytest.mark.parametrize("rig", [{"routes": ("9.9.9.9.1.1",)}], indirect=True)
def test_a_missing_route_is_what_the_message_speaks_of(rig: Rig):
    with pytest.raises(UserError, match="ADS"):
        rig.start()


def head(**changes: int | float) -> bytes:
    values = {"magic": 0x44514341, "version": 1, "size": 64, "slot": 280, "slots": 512, "channels": 6, "frames": 20,
              "reserved": 0, "ns": 50_000, "scale": 0.02, "boot": 7, "overruns": 0, "newest": 9} | changes  # fmt: skip
    scale = [values.pop("scale")] * 6
    numbers = list(values.values())
    return struct.pack("<IHHIHHHHI6fIIQ", *numbers[:9], *scale, *numbers[9:])


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"magic": 0}, "has the PLC program started"),
        ({"version": 2}, "version 2"),
        ({"size": 60}, "head of 60 bytes"),
        ({"slot": 288}, "pack_mode 1"),
        ({"channels": 5}, "5 channels"),
        ({"frames": 0}, "0 frames"),
        ({"scale": 0.0}, "fScale"),
        ({"scale": float("nan")}, "fScale"),
    ],
)
def test_a_head_that_is_not_ours_is_refused_with_the_reason(changes, complaint):
    assert len(head()) == HEAD_BYTES == 64 and parse_head(head()).newest == 9
    with pytest.raises(RingError, match=complaint):
        parse_head(head(**changes))


def test_slots_are_whole_only_when_both_sequence_numbers_agree():
    ring = parse_head(head())
    table = np.zeros(4, ring.slot_type)
    table["seq"] = table["seq_end"] = [5, 6, 7, 8]
    table["samples"][1, 2, 3] = 42
    slots = read_slots(ring, table.tobytes(), 5)
    assert slots.seq.tolist() == [5, 6, 7, 8] and slots.codes.shape == (4, 20, 6) and slots.codes[1, 3, 2] == 42
    table["seq_end"][2] = 0
    assert read_slots(ring, table.tobytes(), 5).seq.tolist() == [5, 6, 8]
    assert not len(read_slots(ring, table.tobytes(), 6).seq)


@pytest.mark.parametrize("octets", [3, 50])
def test_an_answer_that_is_cut_off_with_the_connection_costs_seconds_and_no_more(rig: Rig, octets):
    rig.start()
    rig.step(5)
    rig.double.command(cut=octets)
    threading.Timer(0.2, rig.double.command, kwargs={"reset": True}).start()
    if octets > 38:  # behind the header AdsLib waits without end: without a limit of ours this would not return
        with pytest.raises(UserError, match="MAIN_FAST starts again"):
            rig.step()
        return
    rig.step()
    assert not rig.source.health().connected
    for _ in range(5):
        rig.clock.now += 2_000_000_000
        rig.step()
    assert rig.source.health().connected and rig.source.health().reconnects == 1
