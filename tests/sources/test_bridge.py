"""The waveform bridge over Modbus TCP and RTU: damaged answers, exceptions, foreign register maps."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import serial

from acqd.errors import UserError
from acqd.sources.modbus import BridgeSettings, BridgeSource, ModbusLink
from acqd.sources.modbus.registers import MapError, decode_blocks, parse_layout
from tests.doubles.modbus import ModbusRtuDouble, ModbusTcpDouble, PlainBank, WaveformBridge
from tests.doubles.waveform import WaveTable
from tests.sources.bench import START_NS, Tape, VirtualClock


class Rig:
    def __init__(self, link: ModbusLink, **settings: int) -> None:
        self.clock, self.tape = VirtualClock(), Tape()
        self.source = BridgeSource(BridgeSettings(link, **settings), self.clock)
        self.source.connect()
        self.source.open(START_NS)

    def step(self, times: int = 1, seconds: float = 0.02) -> None:
        for _ in range(times):
            self.clock.now += round(seconds * 1e9)
            self.source.exchange()
            while len((block := self.source.read(10_000)).codes):
                self.tape.add(block)


def test_a_slow_bridge_on_a_serial_line(tmp_path):
    """One phase at 2 kHz, as much as 115200 Bd carry."""
    bridge = WaveformBridge(WaveTable(2_000.0, 1), frames=60, clock="lockstep", advance=3)
    with ModbusRtuDouble({1: bridge}) as double:
        rig = Rig(ModbusLink(serial_port=double.path, baudrate=115_200, timeout_s=5.0), poll_ms=90)
        rig.step(30, 0.09)
        assert rig.source.form.rate == 2_000.0 and rig.tape.lost == 0
        rig.tape.offset(bridge.table.codes, 20_000)
        rig.source.close()


@pytest.mark.parametrize("damage", ["garbage", "short", "cut"])
def test_a_damaged_answer_loses_nothing_that_is_still_in_the_ring(damage):
    bridge = WaveformBridge(WaveTable(), clock="lockstep")
    with ModbusTcpDouble({1: bridge}) as double:
        rig = Rig(ModbusLink("127.0.0.1", double.port, timeout_s=3.0), connections=2)
        rig.step(5)
        double.damage_next(damage)
        rig.step(1)
        assert not rig.source.health().connected and rig.source.health().reason
        rig.step(60)
        assert rig.source.health().connected and rig.source.health().reconnects == 1
        rig.tape.offset(bridge.table.codes, 60_000)
        rig.source.close()


def test_block_numbers_start_over_after_2_to_the_32():
    bridge = WaveformBridge(WaveTable(), clock="lockstep")
    layout_wrap = 0xFFFF_FFFF // bridge.slots * bridge.slots
    bridge._clock._steps = layout_wrap - 500
    with ModbusTcpDouble({1: bridge}) as double:
        rig = Rig(ModbusLink("127.0.0.1", double.port, timeout_s=5.0))
        rig.step(100)
        assert rig.source.health().connected and rig.tape.lost == 0
        assert len(rig.tape.index) > 90 * 400
        rig.source.close()


def test_a_slow_look_at_the_ring_invents_no_gap():
    bridge = WaveformBridge(WaveTable(), clock="lockstep", slots=500)
    with ModbusTcpDouble({1: bridge}) as double:
        rig = Rig(ModbusLink("127.0.0.1", double.port, timeout_s=5.0))
        rig.step(20)
        read = rig.source._client.read

        def late(unit, reads):
            if reads[0][1] == 22:  # the look at the header takes 0.4 s more than usual
                rig.clock.now += 400_000_000
                bridge._clock._steps += 400
            return read(unit, reads)

        rig.source._client.read = late
        rig.step(1)
        rig.source._client.read = read
        rig.step(20)
        assert rig.tape.lost == 0
        rig.tape.offset(bridge.table.codes, 60_000)
        rig.source.close()


def test_status_bits_become_row_flags():
    bridge = WaveformBridge(WaveTable(), clock="lockstep")
    with ModbusTcpDouble({1: bridge}) as double:
        rig = Rig(ModbusLink("127.0.0.1", double.port, timeout_s=5.0))
        rig.step(5)
        bridge.mark(2 | 4, 30)
        rig.step(10)
        assert rig.tape.flagged("clock_unlocked") == rig.tape.flagged("invalid") == 30 * 20
        rig.source.close()


def test_a_ring_that_stands_still_is_named():
    bridge = WaveformBridge(WaveTable(), clock="lockstep")
    with ModbusTcpDouble({1: bridge}) as double:
        rig = Rig(ModbusLink("127.0.0.1", double.port, timeout_s=5.0))
        rig.step(5)
        double.set_stale(True)
        rig.step(30)
        assert "stands still" in rig.source.health().reason
        rig.source.close()


def refusal(double: ModbusTcpDouble, **settings: int) -> str:
    source = BridgeSource(BridgeSettings(ModbusLink("127.0.0.1", double.port), **settings))
    with pytest.raises(UserError) as caught:
        source.connect()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_what_is_no_bridge_is_refused_with_the_reason():
    bridge = WaveformBridge(WaveTable(), clock="lockstep")
    with ModbusTcpDouble({1: bridge, 2: PlainBank([0] * 100)}) as double:
        assert "expected 0x41435144" in refusal(double, unit=2)
        assert "unit 9" in refusal(double, unit=9)
        double.set_exception(2)
        assert "no such register" in refusal(double)
        double.set_exception(None)
        assert "ring holds 512 ms" in refusal(double, poll_ms=200)
        double.set_silent(True)
        assert "does not answer" in refusal(double)
        port = double.port
    source = BridgeSource(BridgeSettings(ModbusLink("127.0.0.1", port)))
    with pytest.raises(UserError, match="check address, cable and power"):
        source.connect()


def test_serial_ports_that_cannot_be_used_are_named(tmp_path):
    with pytest.raises(UserError, match="there is no /dev/ttyNOWHERE"):
        BridgeSource(BridgeSettings(ModbusLink(serial_port="/dev/ttyNOWHERE"))).connect()
    with (
        ModbusRtuDouble({1: PlainBank([0] * 100)}) as double,
        serial.Serial(double.path, exclusive=True),
        pytest.raises(UserError, match="in use by another program"),
    ):
        BridgeSource(BridgeSettings(ModbusLink(serial_port=double.path))).connect()


def header(**changes: int | float) -> bytes:
    values = {"magic": 0x41435144, "version": 1, "channels": 6, "frames": 20, "rate": 20_000_000, "slots": 500,
              "stride": 125, "slot0": 64, "scale": 0.02} | changes  # fmt: skip
    scale = [values.pop("scale")] * 6
    return struct.pack(">IHHHIHHH6f", *values.values(), *scale).ljust(66, b"\0")


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"magic": 0x51444143}, "wrong order"),
        ({"version": 3}, "version 3"),
        ({"channels": 3}, "3 channels"),
        ({"stride": 100}, "stride of 100"),
        ({"frames": 21, "stride": 131}, "at most 125"),
        ({"slots": 600}, "65536"),
        ({"scale": 0.0}, "scales"),
    ],
)
def test_a_header_that_is_not_ours_is_refused_with_the_reason(changes, complaint):
    assert parse_layout(header()).address(501) == 64 + 125
    with pytest.raises(MapError, match=complaint):
        parse_layout(header(**changes))


def test_a_slot_with_another_block_is_not_taken():
    layout = parse_layout(header(frames=1, channels=2, stride=7))
    data = struct.pack(">HHHIhhHHHIhh", 65_535, 1, 0, 70_000, -5, 6, 9, 0, 1, 2, 7, 8)
    blocks = decode_blocks(layout, 0x2_FFFF, data)
    assert blocks.valid.tolist() == [True, False] and blocks.counter.tolist() == [70_000, 2**32 + 2]
    np.testing.assert_array_equal(blocks.codes[0], [[-5, 6]])
