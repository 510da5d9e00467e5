"""Beckhoff terminals on an EtherCAT segment."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from acqd.errors import UserError
from acqd.sources.ethercat import EthercatSettings, EthercatSource
from acqd.sources.ethercat.bus import close_master, open_master, scan
from tests.doubles.ethercat.control import EtherCatDouble
from tests.doubles.veth import may_create_veth, veth_pair
from tests.doubles.waveform import WaveTable
from tests.sources.bench import START_NS, Tape, VirtualClock, connect_patiently

PATIENT_US = 3_000_000
"""The double answers in lockstep; a busy machine may keep it from the processor for a while."""
pytestmark = pytest.mark.skipif(not may_create_veth(), reason="veth pairs need CAP_NET_ADMIN (root)")


class Rig:
    """A source on a segment, in lockstep."""

    def __init__(self, stack: ExitStack, **double: object) -> None:
        self.firmware = double.get("firmware")
        self.near, far = stack.enter_context(veth_pair("acqdtst"))
        self.double = stack.enter_context(EtherCatDouble(far, **double))  # type: ignore[arg-type]
        self.settings = EthercatSettings(self.near, oversampling=20, receive_us=PATIENT_US)
        self.clock, self.tape, self.stack = VirtualClock(), Tape(), stack

    def start(self, **changes: object) -> EthercatSource:
        self.source = EthercatSource(replace(self.settings, **changes), self.clock)  # type: ignore[arg-type]
        self.stack.callback(self.source.close)
        connect_patiently(self.source)
        self.source.open(START_NS)
        return self.source

    def step(self, times: int = 1, period_ns: int | None = None) -> None:
        for _ in range(times):
            self.clock.now += period_ns or self.source.period_ns
            self.source.exchange()
            while len((block := self.source.read(10_000)).codes):
                self.tape.add(block)

    def until(self, condition: Callable[[], bool]) -> None:
        for _ in range(4_000):
            if condition():
                return
            self.step()
        raise AssertionError(str(self.source.health()))


@pytest.fixture
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    with ExitStack() as stack:
        yield Rig(stack, **getattr(request, "param", {}))


@pytest.mark.parametrize(
    ("rig", "oversampling"), [({"advance_ns": 1_250_000}, 100), ({"advance_ns": 125_000}, 10)], indirect=["rig"]
)
def test_a_block_that_is_read_four_times_counts_once(rig: Rig, oversampling):
    source = rig.start(oversampling=oversampling)
    assert source.period_ns == (1_250_000 if oversampling == 100 else 500_000)
    rig.step(1_500, period_ns=1_250_000 if oversampling == 100 else 125_000)
    assert rig.tape.lost == 0 and source.health().lost == 0 and len(rig.tape.index) > 1_000
    rig.tape.offset(WaveTable(seed=1).codes, 60_000)


@pytest.mark.parametrize("rig", [{"terminals": 3}], indirect=True)
def test_phases_of_three_terminals_make_one_stream(rig: Rig):
    rig.start(terminals=3, phases=("1:L1", "2:L2", "3:L3"))
    rig.step(200)
    assert rig.tape.lost == 0
    tables = [WaveTable(seed=1 + terminal) for terminal in range(3)]

    def codes(first: int, count: int) -> np.ndarray:
        return np.hstack([table.codes(first, count)[:, 2 * k : 2 * k + 2] for k, table in enumerate(tables)])

    rig.tape.offset(codes, 60_000)


def test_lost_frames_are_a_gap_of_exactly_their_blocks_and_no_outage(rig: Rig):
    source = rig.start()
    rig.step(150)
    source._segment._receive_us = 2_000
    rig.double.command(drop_frames=3)
    rig.step(3)
    source._segment._receive_us = PATIENT_US
    rig.step(67)
    assert rig.tape.lost == 60 and source.health().connected and source.health().reconnects == 0
    rig.tape.offset(WaveTable(seed=1).codes, 60_000)


def test_a_repeated_block_is_passed_over(rig: Rig):
    rig.start()
    rig.step(150)
    rig.double.command(repeat=5)
    rig.step(50)
    assert rig.tape.lost == 0
    rig.tape.offset(WaveTable(seed=1).codes, 60_000)


def test_a_terminal_that_falls_out_of_op_is_taken_back(rig: Rig):
    source = rig.start()
    rig.step(150)
    rig.double.command(al_error=0x1A, terminal=0)
    rig.until(lambda: not source.health().connected or "AL status" in source.health().reason)
    assert "0x001a" in source.health().reason
    rig.until(lambda: rig.double.stats()["state"] == 8)
    rig.step(700)
    assert source.health().connected
    rig.tape.offset(WaveTable(seed=1).codes, 60_000)


def test_terminals_that_deliver_no_new_blocks_are_started_again(rig: Rig):
    source = rig.start()
    rig.step(150)
    rig.double.command(repeat=100_000)
    rig.until(lambda: not source.health().connected)
    assert "no new blocks" in source.health().reason


def test_a_lost_slave_is_named_and_the_segment_started_again(rig: Rig):
    source = rig.start()
    rig.step(150)
    source._segment._receive_us = 2_000
    rig.double.command(lose_slave=0)
    rig.until(lambda: not source.health().connected)
    assert "slave" in source.health().reason or "EL3783" in source.health().reason
    rig.double.command(restore_slave=0)
    before, rig.tape = rig.tape, Tape()
    rig.until(lambda: bool(rig.tape.blocks))
    rig.step(50)
    assert source.health().connected and source.health().reconnects == 1
    assert rig.tape.blocks[0].index > before.blocks[-1].index
    rig.tape.offset(WaveTable(seed=1).codes, 60_000)


@pytest.mark.parametrize(("fault", "flag"), [("sync_error", "sync_error"), ("invalid", "invalid")])
def test_status_bits_become_row_flags_and_a_warning(rig: Rig, fault, flag):
    source = rig.start()
    rig.step(150)
    rig.double.command(**{fault: True})
    rig.step(5)
    assert flag in rig.tape.blocks[-1].flags and "terminal 1" in source.health().reason
    rig.double.command(**{fault: False})
    rig.step(5)
    assert not rig.tape.blocks[-1].flags and not source.health().reason


def test_automatic_range_keeps_the_current_whichever_range_it_was_taken_in(rig: Rig):
    source = rig.start(current_range="auto")
    assert source.form.bits == 32
    rig.step(150)
    rig.double.command(range="1A", channel=0)
    rig.step(50)
    rig.double.command(range="5A", channel=0)
    rig.step(50)
    assert rig.tape.lost == 0
    wave = WaveTable(seed=1)
    plain = wave.codes(0, 200_000).astype(np.int64)
    first = rig.tape.blocks[0].codes
    # In the 5 A range a digit is five of the 1 A range; in both, code x scale is the same current.
    offset = next(k for k in range(0, 60_000, 20) if np.array_equal(plain[k : k + 20, 0], first[:, 0]))
    codes = np.concatenate([block.codes for block in rig.tape.blocks])
    expected = plain[offset : offset + len(codes)]
    np.testing.assert_array_equal(codes[:, 3], 5 * expected[:, 3])
    clipped = np.clip(5 * expected[:, 1], -32768, 32767)
    coarse, fine = codes[:, 1] == 5 * expected[:, 1], codes[:, 1] == clipped
    assert (coarse | fine).all() and (~coarse).sum() > 100
    assert source.form.scale[1] == pytest.approx(1.8415054 / 32768)


def test_a_range_other_than_the_configured_one_is_no_silent_factor_of_five(rig: Rig):
    source = rig.start(current_range="5A")
    rig.step(150)
    rig.double.command(range="1A", channel=1)
    rig.step(5)
    assert "invalid" in rig.tape.blocks[-1].flags and "1A range" in source.health().reason


@pytest.mark.parametrize(
    "rig",
    [
        {"firmware": {"scalar_words": 2, "counts": "samples"}},
        {"firmware": {"time_words": 2, "counts": "nothing"}, "terminals": 2},
        {"firmware": {"says_range": False}},
    ],
    indirect=True,
)
def test_a_firmware_that_maps_or_counts_otherwise_is_read_all_the_same(rig: Rig):
    two = "time_words" in str(rig.firmware)
    source = rig.start(**({"terminals": 2, "phases": ("1:L1", "2:L1")} if two else {}))
    rig.step(150)
    assert rig.tape.lost == 0 and not source.health().reason
    assert not any(block.flags for block in rig.tape.blocks[1:])
    codes = np.concatenate([block.codes for block in rig.tape.blocks])
    wave = WaveTable(seed=1).codes(0, 200_000)
    offset = next(k for k in range(0, 60_000, 20) if np.array_equal(wave[k : k + 20, 0], codes[:20, 0]))
    np.testing.assert_array_equal(codes[:, :2], wave[offset : offset + len(codes), :2])


@pytest.mark.parametrize("rig", [{"firmware": {"says_range": False}}], indirect=True)
def test_an_automatic_range_that_the_terminal_does_not_report_is_refused(rig: Rig, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("acqd.sources.ethercat.source._START_PAUSE_S", 0.0)
    with pytest.raises(UserError, match="refuses an object"):
        rig.start(current_range="auto")


@pytest.mark.parametrize("rig", [{"product": 0x0EBD3052}], indirect=True)
def test_another_terminal_in_the_slot_is_named(rig: Rig):
    with pytest.raises(UserError, match=r"expected 1 EL3783 .*found 0 .*EK1100.*EL3773"):
        rig.start()


def test_scan_lists_the_slaves(rig: Rig):
    master = open_master(rig.near)
    slaves = scan(master)
    close_master(master)
    assert [(slave.position, slave.title) for slave in slaves] == [(1, "EK1100"), (2, "EL3783")]


def test_the_command_scan_reads_the_assignment_of_terminals_that_were_in_init(rig: Rig):
    command = [sys.executable, "-m", "acqd", "ethercat", "scan", rig.near, "--pdos", "--json"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    coupler, terminal = json.loads(result.stdout)
    assert coupler["title"] == "EK1100" and coupler["pdos"] is None
    assert terminal["title"] == "EL3783" and terminal["pdos"][0].startswith("0x1a00: 16 bits")


def test_bad_settings_are_named(rig: Rig):
    for changes, complaint in (
        ({"interface": "nowhere0"}, "there is no network interface 'nowhere0'"),
        ({"terminals": 2}, "expected 2 EL3783"),
        ({"phases": ("2:L1",)}, "a terminal from 1 to 1"),
        ({"range_object": "9000:01"}, "refuses object 9000:01"),
    ):
        with pytest.raises(UserError, match=complaint):
            rig.start(**changes)


def test_a_cable_out_at_the_start_is_one_clear_line(rig: Rig):
    rig.double.command(cable="out")
    with pytest.raises(UserError, match="no EtherCAT slave answers"):
        rig.start()
