"""The Modbus doubles against an independent client (mbpoll) and against frames written down here."""

from __future__ import annotations

import os
import re
import shutil
import socket
import struct
import subprocess
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest

from tests.doubles.modbus import (
    ModbusFault,
    ModbusProcess,
    ModbusRtuDouble,
    ModbusTcpDouble,
    PlainBank,
    RmsMeter,
    WaveformBridge,
)
from tests.doubles.modbus.wire import crc16
from tests.doubles.waveform import WaveTable
from tests.sources.bench import wait_until_reachable
from tests.waiting import LIMIT_S, wait_for

READ_10 = bytes.fromhex("030000000A")
"""PDU: function 3, address 0, 10 registers."""


def mbpoll(*arguments: str) -> dict[int, int]:
    """Reference -> value, as mbpoll prints it."""
    binary = shutil.which("mbpoll")
    if binary is None:
        pytest.skip("mbpoll is not installed")
    found = subprocess.run([binary, "-1", *arguments], capture_output=True, text=True, timeout=LIMIT_S)
    assert found.returncode == 0, found.stdout + found.stderr
    return {int(at): int(value) for at, value in re.findall(r"^\[(\d+)\]:\s+(-?\d+)", found.stdout, re.M)}


def bank() -> PlainBank:
    return PlainBank([100 + k for k in range(200)])


def adu(pdu: bytes, transaction: int = 1, unit: int = 1) -> bytes:
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


def connect(double: ModbusTcpDouble, timeout: float = LIMIT_S) -> closing[socket.socket]:
    return closing(socket.create_connection(("127.0.0.1", double.port), timeout))


def exactly(sock: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        part = sock.recv(count - len(data))
        if not part:
            raise ConnectionError(data.hex())
        data += part
    return data


def reply(sock: socket.socket) -> tuple[int, int, bytes]:
    """Transaction, unit, PDU."""
    transaction, protocol, length, unit = struct.unpack(">HHHB", exactly(sock, 7))
    assert protocol == 0
    return transaction, unit, exactly(sock, length - 1)


def ask(sock: socket.socket, pdu: bytes, unit: int = 1) -> bytes:
    sock.sendall(adu(pdu, unit=unit))
    return reply(sock)[2]


def registers(pdu: bytes) -> list[int]:
    assert pdu[1] == len(pdu) - 2
    return list(struct.unpack(f">{pdu[1] // 2}H", pdu[2:]))


@contextmanager
def line(path: str) -> Iterator[int]:
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def listen(descriptor: int, count: int, seconds: float = LIMIT_S) -> bytes:
    """Up to `count` characters, fewer where the line stays silent."""
    data, deadline = b"", time.monotonic() + seconds
    while len(data) < count and time.monotonic() < deadline:
        try:
            data += os.read(descriptor, count - len(data))
        except BlockingIOError:
            time.sleep(0.0005)
    return data


def rtu(unit: int, pdu: bytes) -> bytes:
    body = bytes((unit,)) + pdu
    return body + crc16(body)


# ---- wire ----------------------------------------------------------------------------------------------------------


def test_crc_of_the_standards_example() -> None:
    """Modbus over Serial Line V1.02, appendix B: 02 07 has the CRC 41 12."""
    assert crc16(bytes.fromhex("0207")).hex() == "4112"
    assert crc16(bytes.fromhex("010300000002")).hex() == "c40b"


def test_tcp_with_mbpoll() -> None:
    with ModbusTcpDouble({1: bank(), 7: PlainBank([7, 8, 9])}) as double:
        at = ("-m", "tcp", "-p", str(double.port), "127.0.0.1")
        assert mbpoll(*at, "-a", "1", "-t", "4", "-r", "1", "-c", "10") == {k + 1: 100 + k for k in range(10)}
        assert mbpoll(*at, "-a", "7", "-t", "3", "-r", "2", "-c", "2") == {2: 8, 3: 9}
        mbpoll(*at, "-a", "7", "-t", "4", "-r", "1", "--", "11", "12")
        assert mbpoll(*at, "-a", "7", "-t", "4", "-r", "1", "-c", "3") == {1: 11, 2: 12, 3: 9}


@pytest.mark.parametrize("baudrate", [None, 19200])
def test_rtu_with_mbpoll(baudrate: int | None) -> None:
    with ModbusRtuDouble({3: bank(), 4: PlainBank([4])}, baudrate) as double:
        at = ("-m", "rtu", "-b", "19200", double.path)
        assert mbpoll(*at, "-a", "3", "-t", "4", "-r", "1", "-c", "10") == {k + 1: 100 + k for k in range(10)}
        mbpoll(*at, "-a", "4", "-t", "4", "-r", "1", "--", "44")
        assert mbpoll(*at, "-a", "4", "-t", "3", "-r", "1") == {1: 44}


@pytest.mark.parametrize(
    ("pdu", "code"),
    [
        ("0100000001", 1),
        ("2B0E0100", 1),
        ("0300C70002", 2),
        ("03FFFF0002", 2),
        ("060F000001", 2),
        ("030000007E", 3),
        ("0300000000", 3),
        ("0300", 3),
        ("100000000203000100", 3),
    ],
)
def test_exceptions(pdu: str, code: int) -> None:
    request = bytes.fromhex(pdu)
    with ModbusTcpDouble({1: bank()}) as double, connect(double) as sock:
        assert ask(sock, request) == bytes((request[0] | 0x80, code))


def test_unknown_unit() -> None:
    with ModbusTcpDouble({1: bank()}) as double, connect(double) as sock:
        assert ask(sock, READ_10, unit=9) == bytes((0x83, 0x0B))
    with ModbusRtuDouble({1: bank()}) as serial, line(serial.path) as port:
        os.write(port, rtu(9, READ_10))
        assert listen(port, 1, 0.1) == b""


def test_several_requests_in_one_segment_and_one_in_pieces() -> None:
    with ModbusTcpDouble({1: bank()}) as double, connect(double) as sock, connect(double) as other:
        frames = b"".join(adu(struct.pack(">BHH", 3, k, 2), transaction=k) for k in range(20))
        sock.sendall(frames[:-5])
        assert [reply(sock)[0] for _ in range(19)] == list(range(19))
        assert registers(ask(other, READ_10))[0] == 100
        sock.sendall(frames[-5:])
        assert reply(sock) == (19, 1, struct.pack(">BBHH", 3, 4, 119, 120))
        assert double.connections == 2 and double.requests == {1: 21}


def test_header_of_another_protocol_ends_the_connection() -> None:
    with ModbusTcpDouble({1: bank()}) as double, connect(double) as sock:
        sock.sendall(b"GET / HTTP/1.1\r\n\r\n")
        with pytest.raises(ConnectionError):
            reply(sock)


def test_rtu_frames() -> None:
    """Requests in one write, in pieces, with a wrong CRC, of an unknown function, and to all."""
    with ModbusRtuDouble({1: bank(), 2: PlainBank([5])}) as double, line(double.path) as port:
        one, two = rtu(1, READ_10), rtu(2, bytes.fromhex("0300000001"))
        os.write(port, one + two)
        assert listen(port, 32) == rtu(1, bytes((3, 20)) + struct.pack(">10H", *range(100, 110))) + rtu(2, b"\3\2\0\5")

        def answered_in_pieces() -> bool:
            """A pause of 20 ms, which a busy machine makes, ends a frame."""
            os.write(port, one[:3])
            time.sleep(0.005)
            os.write(port, one[3:])
            return len(listen(port, 25, 0.2)) == 25

        wait_for(answered_in_pieces, "a request in pieces is answered")
        os.write(port, one[:-1] + b"\0")
        assert listen(port, 1, 0.05) == b""
        os.write(port, rtu(2, bytes.fromhex("11")))
        assert listen(port, 5) == rtu(2, bytes((0x91, 1)))
        os.write(port, rtu(0, bytes.fromhex("060000002A")))
        os.write(port, two)
        assert listen(port, 7) == rtu(2, b"\3\2\0\x2a")


def test_throttle_takes_the_time_of_a_line() -> None:
    """8 + 3.5 + 25 characters of 11 bit, so half the time at twice the rate."""

    for baudrate in (9600, 19200):
        due_s = 36.5 * 11 / baudrate
        with ModbusRtuDouble({1: bank()}, baudrate) as double, line(double.path) as port:

            def in_time() -> bool:
                """Never earlier; later only where the machine was busy."""
                began = time.monotonic()
                os.write(port, rtu(1, READ_10))
                assert len(listen(port, 25)) == 25
                took_s = time.monotonic() - began
                assert took_s > 0.99 * due_s  # noqa: B023
                return took_s < 1.1 * due_s  # noqa: B023

            wait_for(in_time, "an answer in time")


# ---- faults --------------------------------------------------------------------------------------------------------


def test_latency_does_not_serialise_requests() -> None:
    with ModbusTcpDouble({1: bank()}) as double, connect(double) as sock:
        double.set_latency(0.1)

        def together() -> bool:
            """Two answers, one after the other, would take 0.2 s."""
            began = time.monotonic()
            sock.sendall(adu(READ_10, 1))
            time.sleep(0.02)
            sock.sendall(adu(READ_10, 2))
            assert reply(sock)[0] == 1 and time.monotonic() - began >= 0.095
            assert reply(sock)[0] == 2
            return time.monotonic() - began < 0.19

        wait_for(together, "two answers in less than two latencies")


def test_reset_and_refusal() -> None:
    with ModbusTcpDouble({1: bank()}) as double:
        with connect(double) as sock:
            ask(sock, READ_10)
            double.reset_connections()
            with pytest.raises(ConnectionResetError):
                ask(sock, READ_10)
        with connect(double) as sock:
            ask(sock, READ_10)
            double.refuse(LIMIT_S)
            with pytest.raises(ConnectionRefusedError):
                connect(double)
            double.refuse(0.1)
        wait_until_reachable("127.0.0.1", double.port)
        with connect(double) as sock:
            assert registers(ask(sock, READ_10))[9] == 109


def _takes(port: int) -> bool:
    try:
        os.write(port, b"x")
    except OSError:
        return False
    return True


def test_unplugged_adapter() -> None:
    with ModbusRtuDouble({1: bank()}) as double:
        with line(double.path) as port:
            double.refuse(LIMIT_S)
            wait_for(lambda: not Path(double.path).exists(), "the adapter is gone")
            wait_for(lambda: not _takes(port), "the open port fails")
        double.refuse(0.1)
        wait_for(lambda: Path(double.path).exists(), "the adapter is back")
        with line(double.path) as port:
            os.write(port, rtu(1, READ_10))
            assert len(listen(port, 25)) == 25
        double.refuse(10 * LIMIT_S)
        began = time.monotonic()
    assert time.monotonic() - began < LIMIT_S


def test_exception_for_one_unit_or_all() -> None:
    with ModbusTcpDouble({1: bank(), 2: bank()}) as double, connect(double) as sock:
        double.set_exception(6, unit=2)
        assert ask(sock, READ_10, unit=2) == bytes((0x83, 6)) and ask(sock, READ_10)[0] == 3
        double.set_exception(4)
        assert ask(sock, READ_10) == bytes((0x83, 4)) and ask(sock, READ_10, unit=2)[1] == 6
        double.set_exception(None)
        double.set_exception(None, unit=2)
        assert ask(sock, READ_10, unit=2)[0] == 3


def test_silent_unit() -> None:
    with ModbusTcpDouble({1: bank(), 2: bank()}) as double, connect(double) as sock:
        double.set_silent(unit=2)
        sock.sendall(adu(READ_10, 5, unit=2) + adu(READ_10, 6, unit=1))
        assert reply(sock)[:2] == (6, 1)
        double.set_silent(False, unit=2)
        assert ask(sock, READ_10, unit=2)[0] == 3


def test_stale_registers() -> None:
    plain = bank()
    with ModbusTcpDouble({1: plain}) as double, connect(double) as sock:
        double.set_stale()
        ask(sock, READ_10)
        plain.write(0, [1])
        assert registers(ask(sock, READ_10))[0] == 100
        double.set_stale(False)
        assert registers(ask(sock, READ_10))[0] == 1


def test_damaged_answers_on_tcp() -> None:
    with ModbusTcpDouble({1: bank(), 2: bank()}) as double, connect(double) as sock:
        double.damage_next("garbage", unit=2)
        double.damage_next("short")
        sock.sendall(adu(READ_10, 5))
        assert len(registers(reply(sock)[2])) == 9
        sock.sendall(adu(READ_10, 5, unit=2))
        assert reply(sock)[0] == 5 ^ 0x5555
        double.damage_next("cut")
        sock.sendall(adu(READ_10))
        sock.settimeout(0.1)
        with pytest.raises(TimeoutError):
            exactly(sock, 29)


def test_damaged_answers_on_rtu() -> None:
    with ModbusRtuDouble({1: bank()}) as double, line(double.path) as port:
        for kind, length, right in (("garbage", 25, False), ("short", 23, True), ("cut", 12, False)):
            double.damage_next(kind)  # type: ignore[arg-type]
            os.write(port, rtu(1, READ_10))
            frame = listen(port, 25, 0.1)
            assert len(frame) == length and (frame[-2:] == crc16(frame[:-2])) is right
        os.write(port, rtu(1, READ_10))
        assert len(listen(port, 25)) == 25


# ---- waveform bridge -----------------------------------------------------------------------------------------------


def header(bridge: WaveformBridge) -> dict[str, int]:
    h = bridge.read_bytes(3, 0, 33)
    return {
        "rate": struct.unpack_from(">I", h, 10)[0],
        "overruns": struct.unpack_from(">I", h, 44)[0],
        "oldest": struct.unpack_from(">I", h, 48)[0],
        "newest": struct.unpack_from(">I", h, 52)[0],
        "utc": struct.unpack_from(">Q", h, 56)[0],
        "boot": struct.unpack_from(">H", h, 64)[0],
    }


def slot(bridge: WaveformBridge, block: int) -> tuple[int, int, int, np.ndarray]:
    """Block number's low word, status, first frame, samples [frames, channels]."""
    address = bridge.slot0 + block % bridge.slots * bridge.stride
    data = bridge.read_bytes(3, address, bridge.frames * bridge.channels + 5)
    number, status, high, low = struct.unpack_from(">HHHI", data)
    samples = np.frombuffer(data, ">i2", offset=10).reshape(bridge.frames, bridge.channels)
    return number, status, high << 32 | low, samples


def test_bridge_header_as_registers() -> None:
    table = WaveTable(seconds=1.0)
    bridge = WaveformBridge(table, clock="lockstep")
    words = bridge.read(4, 0, 33)
    assert words[:10] == [0x4143, 0x5144, 1, 6, 20, 20_000_000 >> 16, 20_000_000 & 0xFFFF, 512, 125, 64]
    lsb = struct.unpack(">6f", struct.pack(">12H", *words[10:22]))
    assert lsb == pytest.approx(table.scale, rel=1e-6)
    assert words[22:28] == [0, 0, 0, 0, 0, 19] and words[32] == 1
    assert abs((header(bridge)["utc"] - time.time_ns()) * 1e-9) < 2


@pytest.mark.parametrize("phases", [1, 2, 3])
def test_bridge_slots_have_the_samples_of_the_table(phases: int) -> None:
    table = WaveTable(phases=phases, seconds=1.0)
    bridge = WaveformBridge(table, clock="lockstep", advance=300)
    assert bridge.stride == 125 and bridge.frames * bridge.channels == 120
    for _ in range(5):
        newest = header(bridge)["newest"]
        for block in (newest - 299, newest - 1, newest):
            number, status, first, samples = slot(bridge, block)
            assert (number, status, first) == (block & 0xFFFF, 0, block * bridge.frames)
            np.testing.assert_array_equal(samples, table.codes(first, bridge.frames))
    assert header(bridge)["oldest"] == 1800 - 1 - 512 + 2


def test_bridge_before_its_first_block() -> None:
    bridge = WaveformBridge(WaveTable(seconds=1.0), clock="lockstep", advance=0, utc=False)
    found = header(bridge)
    assert (found["newest"], found["oldest"], found["utc"]) == (0xFFFFFFFF, 0, 0)
    assert slot(bridge, 0)[:2] == (0xFFFF, 4)


def test_bridge_illegal_addresses() -> None:
    bridge = WaveformBridge(WaveTable(seconds=1.0), slots=10)
    for address, count in ((33, 1), (30, 4), (60, 10), (64 + 1250, 1), (64 + 1240, 11)):
        with pytest.raises(ModbusFault) as fault:
            bridge.read(3, address, count)
        assert fault.value.code == 2
    bridge.read(3, 64 + 1240, 10)
    with pytest.raises(ValueError, match="65535"):
        WaveformBridge(WaveTable(seconds=1.0), slots=600)


def test_bridge_follows_real_time() -> None:
    """1000 blocks/s; the drift shows."""
    table = WaveTable(seconds=1.0)
    for drift_ppm, per_s in ((0, 1000), (100_000, 1100)):
        before = time.monotonic()
        bridge = WaveformBridge(table, drift_ppm=drift_ppm)
        made = time.monotonic()
        time.sleep(0.1)
        asked = time.monotonic()
        newest = header(bridge)["newest"]
        assert per_s * (asked - made) - 2 <= newest <= per_s * (time.monotonic() - before)


def test_bridge_skips_blocks() -> None:
    bridge = WaveformBridge(WaveTable(seconds=1.0), clock="lockstep", advance=10, slots=16)
    assert header(bridge)["newest"] == 9
    bridge.skip(5)
    found = header(bridge)
    assert (found["newest"], found["overruns"], found["oldest"]) == (19, 5, 5)
    assert slot(bridge, 15)[2] == 15 * 20
    assert slot(bridge, 12)[:2] == (0xFFFF, 4)
    bridge.skip(10)
    found = header(bridge)
    assert (found["newest"], found["overruns"]) == (19, 15)


def test_bridge_restart_status_and_freeze() -> None:
    bridge = WaveformBridge(WaveTable(seconds=1.0), clock="lockstep")
    header(bridge)
    bridge.mark(1, 3)
    header(bridge)
    assert [slot(bridge, block)[1] for block in range(18, 25)] == [0, 0, 1, 1, 1, 0, 0]
    bridge.stale = True
    assert header(bridge)["newest"] == header(bridge)["newest"] == 39
    bridge.stale = False
    assert header(bridge)["newest"] == 59
    bridge.restart()
    found = header(bridge)
    assert (found["newest"], found["boot"], found["overruns"]) == (19, 2, 0)


def _newest(sock: socket.socket) -> int:
    return int(struct.unpack(">I", ask(sock, struct.pack(">BHH", 3, 26, 2))[2:])[0])


def test_bridge_hands_out_every_block_once() -> None:
    """250 blocks, one request after the other, several times round the ring."""
    table = WaveTable(seconds=1.0)
    bridge = WaveformBridge(table, clock="lockstep", slots=64)
    following = 0
    with ModbusTcpDouble({1: bridge}) as double, connect(double) as sock:
        while following < 250:
            for block in range(following, _newest(sock) + 1):
                pdu = ask(sock, struct.pack(">BHH", 3, 64 + block % 64 * 125, 125))
                assert struct.unpack_from(">H", pdu, 2)[0] == block
                np.testing.assert_array_equal(
                    np.frombuffer(pdu, ">i2", offset=12).reshape(20, 6), table.codes(20 * block, 20)
                )
                following = block + 1


# ---- meters --------------------------------------------------------------------------------------------------------

PLACES = {
    "sdm630": (4, ">f", False, {"U1": 0, "I3": 10, "P2": 14, "S1": 18, "PF3": 34, "P": 52, "f": 70, "import_kwh": 72}),
    "sdm120": (4, ">f", False, {"U1": 0, "I1": 6, "P1": 12, "S1": 18, "PF1": 30, "f": 70, "export_kwh": 74}),
    "em340": (4, ">i", True, {"U2": 2, "I1": 12, "P3": 22, "S1": 24, "P": 40, "import_kwh": 52, "export_kwh": 78}),
    "b23": (3, ">i", False, {"U1": 0x5B00, "I2": 0x5B0E, "P": 0x5B14, "P3": 0x5B1A, "S": 0x5B24}),
    "iem3155": (3, ">f", False, {"I1": 2999, "U1": 3027, "P1": 3053, "P": 3059, "S": 3075, "f": 3109, "PF": 3083}),
    "pro3em": (4, ">f", True, {"P": 1013, "S": 1015, "U1": 1020, "I2": 1042, "P3": 1064, "PF1": 1028}),
}
SCALES = {("em340", "I"): 0.001, ("em340", ""): 0.1, ("b23", "U"): 0.1, ("b23", ""): 0.01}


def scale(model: str, name: str) -> float:
    if model == "iem3155" and name[0] in "PS" and name != "PF":
        return 1000.0
    return SCALES.get((model, name[0]), SCALES.get((model, ""), 1.0))


@pytest.mark.parametrize("model", PLACES)
@pytest.mark.parametrize("swapped", [False, True])
def test_meter_registers(model: str, swapped: bool) -> None:
    function, form, low_first, places = PLACES[model]
    meter = RmsMeter(model, swap_words=swapped, refresh_s=60)
    for name, address in places.items():
        words = meter.read(function, address, 2)
        ordered = words[::-1] if low_first != swapped else words
        value = struct.unpack(form, struct.pack(">2H", *ordered))[0] * scale(model, name)
        assert value == pytest.approx(meter.values[name], rel=1e-9), name


def test_meter_values_are_near_their_set_points() -> None:
    for model in PLACES:
        values = RmsMeter(model, Vrms=231, Irms=3, lag=0.5, f=50).values
        assert values["U1"] == pytest.approx(231, rel=0.01) and values["I1"] == pytest.approx(3, rel=0.01)
        assert values["P1"] == pytest.approx(231 * 3 * np.cos(0.5), rel=0.02)
        assert values["import_kwh"] == pytest.approx(1234.5, abs=0.1)


def test_meter_single_registers() -> None:
    em340 = RmsMeter("em340")
    assert em340.read(3, 0x000B, 1) == [341]
    assert em340.read(4, 0x33, 1) == [500] and em340.read(4, 0x31, 1) == [921]
    b23 = RmsMeter("b23")
    assert b23.read(3, 0x5B2C, 1) == [5000] and b23.read(3, 0x5B3A, 1) == [921]
    assert b23.read(3, 0x5000, 4) == [0, 0, 1, 57914]
    assert RmsMeter("iem3155").read(3, 0x0C83, 4) == [0, 0, 18, 54852]


def test_meter_refusals_and_freeze() -> None:
    now = [0.0]
    meter = RmsMeter("sdm630", faulty={0x46: 4}, max_count=80, clock=lambda: now[0])
    for asked, code in (((3, 0, 2), 1), ((4, 0, 81), 3), ((4, 0x4C, 2), 2), ((4, 0x44, 4), 4)):
        with pytest.raises(ModbusFault) as fault:
            meter.read(*asked)
        assert fault.value.code == code
    before = meter.values
    now[0] = 3600.0
    meter.stale = True
    assert meter.values == before
    meter.stale = False
    assert meter.values["import_kwh"] - before["import_kwh"] == pytest.approx(before["P"] / 1000, rel=0.02)


# ---- process -------------------------------------------------------------------------------------------------------


def test_bridge_as_a_process() -> None:
    with ModbusProcess("bridge", "--phases", "1", "--clock", "lockstep", "--advance", "7") as double:
        with closing(socket.create_connection(("127.0.0.1", double.port), 3)) as sock:
            assert registers(ask(sock, struct.pack(">BHH", 3, 26, 2))) == [0, 6]
            assert double.do("skip", blocks=3) is None
            assert double.do("requests") == {"1": 1}
            assert registers(ask(sock, struct.pack(">BHH", 3, 22, 6))) == [0, 3, 0, 0, 0, 13]
        with pytest.raises(ValueError, match="nonsense"):
            double.do("nonsense")


def test_meters_as_a_process() -> None:
    with ModbusProcess("meters", "--model", "sdm630", "--units", "1-3,7", "--rtu") as double, line(double.path) as port:
        double.do("silent", unit=2)
        os.write(port, rtu(2, bytes.fromhex("0400060002")))
        assert listen(port, 9, 0.05) == b""
        for unit in (1, 3, 7):
            os.write(port, rtu(unit, bytes.fromhex("0400060002")))
            (amperes,) = struct.unpack(">f", listen(port, 9)[3:7])
            assert amperes == pytest.approx(2 + 0.1 * (unit - 1), rel=0.006)
        double.do("set", unit=7, Irms=9.0)
        wait_for(lambda: double.do("values", unit=7)["I1"] == pytest.approx(9, rel=0.006), "the set current")
