"""The ADS double against pyads (AdsLib) and against frames that this file builds itself."""

from __future__ import annotations

import ctypes
import re
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.doubles.ads import AdsDouble, AdsProcess, Settings, unused_host
from tests.doubles.ads.ring import HEAD, slot_dtype
from tests.sources.bench import wait_until_reachable
from tests.waiting import LIMIT_S, wait_for

pyads = pytest.importorskip("pyads")

# The ring as docs/twincat/README.md gives it, written a second time on purpose.
HEAD_FORMAT = struct.Struct("<IHHIHHHHI6fIIQ")
SLOT_BYTES = 280
HEAD_NAME, SLOTS_NAME = "GVL_Acqd.stHead", "GVL_Acqd.aSlots"
CONNECTION_LOST = -1
TIMEOUT = 1861
RAW_CLIENT = bytes([5, 5, 5, 5, 1, 1])
"""AMS net id of the raw frames' sender."""


class Client:
    """What a reader of the ring needs from pyads."""

    def __init__(self, host: str) -> None:
        self.ads = pyads.Connection(f"{host}.1.1", 851, host)
        self.open()
        self.head_place = self._place(HEAD_NAME)
        self.slots_place = self._place(SLOTS_NAME)

    def open(self) -> None:
        self.ads.open()
        self.ads.set_timeout(int(1000 * LIMIT_S))

    def _place(self, name: str) -> tuple[int, int]:
        symbol = self.ads.get_symbol(name)
        return symbol.index_group, symbol.index_offset

    def read(self, place: tuple[int, int], length: int, offset: int = 0) -> bytes:
        return bytes(self.ads.read(place[0], place[1] + offset, ctypes.c_ubyte * length, return_ctypes=True))

    def head(self) -> tuple[Any, ...]:
        return HEAD_FORMAT.unpack(self.read(self.head_place, HEAD_FORMAT.size))

    def newest(self) -> int:
        return int(self.head()[-1])

    def slot(self, seq: int) -> Slot:
        return Slot(self.read(self.slots_place, SLOT_BYTES, seq % 512 * SLOT_BYTES))


class Slot:
    """ST_AcqdSlot with 20 frames."""

    def __init__(self, data: bytes) -> None:
        self.seq, self.dc_time, *status, self.range, self.sample_count = struct.unpack_from("<QQ6HHH", data)
        self.status = tuple(status)
        self.samples = np.frombuffer(data, "<i2", 120, 32).reshape(6, 20)
        self.seq_end = struct.unpack_from("<Q", data, 272)[0]


def error_code(function: Any, *arguments: Any) -> int:
    with pytest.raises(pyads.ADSError) as caught:
        function(*arguments)
    return int(caught.value.err_code)


@pytest.fixture
def double() -> Iterator[AdsDouble]:
    with AdsDouble(Settings(unused_host())) as server:
        yield server


@pytest.fixture
def client(double: AdsDouble) -> Iterator[Client]:
    reader = Client(double.settings.host)
    yield reader
    reader.ads.close()


@pytest.fixture
def real() -> Iterator[AdsDouble]:
    with AdsDouble(Settings(unused_host(), clock="real")) as server:
        yield server


# --- pyads -------------------------------------------------------------------------------------


def test_the_plc_tells_its_state_and_name(client: Client) -> None:
    assert client.ads.read_state() == (5, 0)
    name, version = client.ads.read_device_info()
    assert (name, version.version, version.build) == ("Plc30 App", 3, 4024)


def test_the_symbols_have_the_documented_types_and_sizes(client: Client) -> None:
    symbols = {symbol.name: symbol for symbol in client.ads.get_all_symbols()}
    assert symbols[HEAD_NAME].symbol_type == "ST_AcqdHead"
    assert symbols[SLOTS_NAME].symbol_type == "ARRAY [0..511] OF ST_AcqdSlot"
    assert symbols[SLOTS_NAME].index_group == 0x4040
    assert client.head_place != client.slots_place


def test_the_head_describes_the_ring(client: Client, double: AdsDouble) -> None:
    magic, version, head_size, slot_size, slots, channels, frames, reserved, sample_ns, *rest = client.head()
    assert struct.pack("<I", magic) == b"ACQD"
    assert (version, head_size, slot_size, slots) == (1, 64, SLOT_BYTES, 512)
    assert (channels, frames, reserved, sample_ns) == (6, 20, 0, 50_000)
    assert rest[:6] == pytest.approx(double.wave.scale)
    assert rest[6:] == [double.settings.boot, 0, 20]


def test_slots_hold_the_known_samples_after_the_ring_has_wrapped(client: Client, double: AdsDouble) -> None:
    while (newest := client.newest()) < 1000:
        pass
    for seq in (newest - 511, newest - 1, newest):
        slot = client.slot(seq)
        assert slot.seq == slot.seq_end == seq
        assert np.array_equal(slot.samples.T, double.wave.codes((seq - 1) * 20, 20))
        assert slot.dc_time == client.slot(newest).dc_time - (newest - seq) * 1_000_000
        assert slot.sample_count == (seq - 1) & 0xFFFF
        assert slot.status == (0x8000 * (seq % 2),) * 6


def test_a_read_may_cover_many_slots_and_parts_of_slots(client: Client) -> None:
    client.newest()
    whole = client.read(client.slots_place, 512 * SLOT_BYTES)
    assert client.read(client.slots_place, 1000, 77) == whole[77:1077]
    seqs = np.frombuffer(whole, "<u8").reshape(512, -1)[:, 0]
    assert list(seqs[:22]) == [*range(21), 0]


def test_lockstep_advances_only_when_the_head_is_read(client: Client, double: AdsDouble) -> None:
    assert [client.newest() for _ in range(3)] == [20, 40, 60]
    client.slot(60)
    double.command(advance=3)
    assert client.newest() == 63


def test_one_phase_leaves_the_other_channels_zero() -> None:
    with AdsDouble(Settings(unused_host(), phases=1)) as server:
        client = Client(server.settings.host)
        assert client.head()[5] == 2
        slot = client.slot(20)
        assert np.array_equal(slot.samples[:2].T, server.wave.codes(19 * 20, 20))
        assert not slot.samples[2:].any()
        client.ads.close()


def test_sum_reads_and_sum_writes(client: Client, double: AdsDouble) -> None:
    names = [f"{HEAD_NAME}.nNewest", f"{HEAD_NAME}.nBoot", "MAIN.nTest"]
    assert client.ads.read_list_by_name(names) == dict(zip(names, (20, double.settings.boot, 0), strict=True))
    answer = client.ads.write_list_by_name({"MAIN.nTest": -7, f"{HEAD_NAME}.nBoot": 1})
    assert answer == {"MAIN.nTest": "no error", f"{HEAD_NAME}.nBoot": "reading/writing not permitted"}
    assert client.ads.read_by_name("main.ntest") == -7


def test_handles_are_released(client: Client, double: AdsDouble) -> None:
    handle = client.ads.get_handle(f"{HEAD_NAME}.nSlots")
    assert client.ads.read_by_name("", pyads.PLCTYPE_UINT, handle=handle) == 512
    assert double.command(stats=True)["handles"] == 1
    client.ads.release_handle(handle)
    assert double.command(stats=True)["handles"] == 0
    assert error_code(client.ads.read_by_name, "", pyads.PLCTYPE_UINT, False, handle) == 1808


def test_wrong_requests_get_the_documented_codes(client: Client, double: AdsDouble) -> None:
    assert error_code(client.ads.get_symbol, "GVL_Acqd.stTail") == 1808
    assert error_code(client.read, client.head_place, 65) == 1797
    assert error_code(client.read, (0x4040, 8), 4) == 1795
    assert error_code(client.read, (0x4041, 8), 4) == 1794
    assert error_code(client.ads.write, *client.head_place, 1, pyads.PLCTYPE_UDINT) == 1796
    other_port = pyads.Connection(double.settings.net_id, 852, double.settings.host)
    other_port.open()
    assert error_code(other_port.read_state) == 6
    other_port.close()


def test_cyclic_notifications_arrive_without_a_gap(real: AdsDouble) -> None:
    client = Client(real.settings.host)
    received: list[bytes] = []

    def callback(notification: Any, _: Any) -> None:
        received.append(ctypes.string_at(ctypes.addressof(notification.contents) + 16, HEAD_FORMAT.size))

    attributes = pyads.NotificationAttrib(HEAD_FORMAT.size, pyads.ADSTRANS_SERVERCYCLE, max_delay=20, cycle_time=1)
    handles = client.ads.add_device_notification(HEAD_NAME, attributes, callback)
    wait_for(lambda: len(received) > 100, "notifications")
    client.ads.del_device_notification(*handles)
    client.ads.close()
    newest = [HEAD_FORMAT.unpack(data)[-1] for data in received]
    assert max(np.diff(newest)) <= 2  # the sampling and the slots have the same period, but not the same phase
    assert real.command(stats=True)["notifications"] == 0


def test_on_change_notifications_come_for_each_change(real: AdsDouble) -> None:
    client = Client(real.settings.host)
    values: list[int] = []

    def callback(notification: Any, _: Any) -> None:
        values.append(ctypes.c_int32.from_address(ctypes.addressof(notification.contents) + 16).value)

    attributes = pyads.NotificationAttrib(4, pyads.ADSTRANS_SERVERONCHA, max_delay=1, cycle_time=1)
    handles = client.ads.add_device_notification("MAIN.nTest", attributes, callback)
    for value in (7, 8):
        client.ads.write_by_name("MAIN.nTest", value, pyads.PLCTYPE_DINT)
        wait_for(lambda: value in values, "the change")  # noqa: B023
    client.ads.del_device_notification(*handles)
    client.ads.close()
    # the first value is notified before AdsLib has returned the handle, which then knows no receiver for it
    assert values in ([0, 7, 8], [7, 8])


# --- faults ------------------------------------------------------------------------------------


def test_missed_slots_are_a_gap_in_the_sequence_numbers(client: Client, double: AdsDouble) -> None:
    assert client.newest() == 20
    double.command(skip_slots=5)
    assert client.head()[-2:] == (5, 40)
    assert [client.slot(seq).seq for seq in (20, 21, 25, 26)] == [20, 0, 0, 26]
    assert client.slot(26).dc_time - client.slot(20).dc_time == 6_000_000


def test_a_torn_slot_is_read_once(client: Client, double: AdsDouble) -> None:
    client.newest()
    double.command(tear=True)
    torn, whole = client.slot(20), client.slot(20)
    assert (torn.seq, torn.seq_end) == (20, 0)
    assert whole.seq == whole.seq_end == 20


def test_a_restart_changes_the_boot_number_and_starts_at_one(client: Client, double: AdsDouble) -> None:
    before = [client.head() for _ in range(3)][-1]
    last = client.slot(60).dc_time
    double.command(restart=True)
    after = client.head()
    assert (before[-1], after[-1]) == (60, 20)
    assert after[-3] != before[-3]
    assert client.slot(60).seq == 0
    assert client.slot(1).dc_time > last


def test_a_frozen_plc_answers_with_old_slots(client: Client, double: AdsDouble) -> None:
    client.newest()
    double.command(freeze=True)
    assert [client.newest(), client.newest()] == [20, 20]
    double.command(freeze=False)
    assert client.head()[-2:] == (40, 80)
    assert [client.slot(seq).seq for seq in (20, 21, 60, 61)] == [20, 0, 0, 61]


def test_a_stopped_plc_tells_so_and_runs_again(client: Client, double: AdsDouble) -> None:
    double.command(state=6)
    assert client.ads.read_state() == (6, 0)
    assert client.newest() == 0
    client.ads.write_control(5, 0, 0, pyads.PLCTYPE_INT)
    assert client.ads.read_state() == (5, 0)
    assert client.head()[-2:] == (20, 40)


def test_status_and_range_hold_for_later_slots(client: Client, double: AdsDouble) -> None:
    client.newest()
    double.command(status=0x4040, channel=3)
    double.command(range=0b101)
    client.newest()
    old, new = client.slot(20), client.slot(22)
    assert (old.status[3], old.range) == (0, 0)
    assert (new.status, new.range) == ((0, 0, 0, 0x4040, 0, 0), 0b101)


def test_a_removed_ring_has_no_symbols(client: Client, double: AdsDouble) -> None:
    double.command(remove_ring=True)
    assert error_code(client.ads.get_symbol, HEAD_NAME) == 1808
    assert error_code(client.head) == 1795
    double.command(remove_ring=False)
    assert client.newest() > 0


def test_silence_and_delay_end_in_a_timeout_and_then_recover(client: Client, double: AdsDouble) -> None:
    double.command(silent=True)
    client.ads.set_timeout(200)
    assert error_code(client.ads.read_state) == TIMEOUT
    client.ads.set_timeout(int(1000 * LIMIT_S))
    double.command(silent=False, latency_s=0.2)
    start = time.monotonic()
    assert client.ads.read_state() == (5, 0)
    assert time.monotonic() - start > 0.19


def test_a_reset_connection_fails_until_it_is_opened_again(client: Client, double: AdsDouble) -> None:
    double.command(reset=True)
    client.ads.set_timeout(100)  # until the library has noticed
    wait_for(lambda: error_code(client.ads.read_state) == CONNECTION_LOST, "the loss is noticed")
    client.ads.close()
    client.open()
    assert client.newest() == 20
    assert double.command(stats=True)["accepted"] == 2


def test_new_connections_are_refused_for_a_time(client: Client, double: AdsDouble) -> None:
    client.ads.close()
    double.command(refuse_s=LIMIT_S)
    assert error_code(client.ads.open) == 6
    double.command(refuse_s=0.1)
    wait_until_reachable(double.settings.host, 48_898)
    client.open()
    assert client.ads.read_state() == (5, 0)


def test_new_connections_are_closed_at_once(client: Client, double: AdsDouble) -> None:
    client.ads.close()
    double.command(close_new=True)
    client.open()
    client.ads.set_timeout(400)
    assert error_code(client.ads.read_state) in (TIMEOUT, CONNECTION_LOST)
    double.command(close_new=False)
    client.ads.close()
    client.open()
    assert client.ads.read_state() == (5, 0)


def test_without_a_route_the_connection_is_closed() -> None:
    with AdsDouble(Settings(unused_host(), routes=("1.2.3.4.1.1",))) as server:
        with raw_socket(server) as link:
            link.sendall(raw_request(server, 4, b""))
            with pytest.raises(ConnectionResetError):
                link.recv(100)
        with raw_socket(server) as link:
            known = bytes([1, 2, 3, 4, 1, 1])
            link.sendall(raw_request(server, 4, b"", source=known))
            assert raw_reply(link, known)[-1] == struct.pack("<IHH", 0, 5, 0)


# --- raw frames --------------------------------------------------------------------------------


def raw_socket(server: AdsDouble) -> socket.socket:
    link = socket.create_connection((server.settings.host, 48898), timeout=5)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return link


def raw_request(server: AdsDouble, command: int, data: bytes, *, invoke: int = 77, source: bytes = RAW_CLIENT) -> bytes:
    target = socket.inet_aton(server.settings.host) + b"\1\1"
    ams = target + struct.pack("<H", 851) + source + struct.pack("<HHHIII", 40000, command, 4, len(data), 0, invoke)
    return struct.pack("<HI", 0, len(ams) + len(data)) + ams + data


def raw_reply(link: socket.socket, client: bytes = RAW_CLIENT) -> tuple[int, int, int, int, bytes]:
    """Command, flags, error, invoke id and data."""
    reserved, length = struct.unpack("<HI", receive(link, 6))
    assert reserved == 0
    body = receive(link, length)
    assert body[:8] == client + struct.pack("<H", 40000)
    assert struct.unpack_from("<H", body, 14)[0] == 851
    command, flags, size, error, invoke = struct.unpack_from("<HHIII", body, 16)
    assert size == length - 32
    return command, flags, error, invoke, body[32:]


def receive(link: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        part = link.recv(count - len(data))
        assert part, "the double closed the connection"
        data += part
    return data


def test_raw_read_state_and_read(double: AdsDouble) -> None:
    name = f"{HEAD_NAME}\0".encode()
    with raw_socket(double) as link:
        link.sendall(raw_request(double, 4, b""))
        assert raw_reply(link) == (4, 5, 0, 77, struct.pack("<IHH", 0, 5, 0))
        link.sendall(raw_request(double, 9, struct.pack("<IIII", 0xF007, 0, 12, len(name)) + name, invoke=78))
        result, count, group, offset, size = struct.unpack("<IIIII", raw_reply(link)[4])
        assert (result, count, group, size) == (0, 12, 0x4040, 64)
        link.sendall(raw_request(double, 2, struct.pack("<III", group, offset, size), invoke=79))
        command, flags, error, invoke, data = raw_reply(link)
        assert (command, flags, error, invoke, len(data)) == (2, 5, 0, 79, 72)
        assert data[8:12] == b"ACQD"
        assert struct.unpack_from("<Q", data, 8 + 56)[0] == 20


def test_raw_errors_are_in_the_payload_or_in_the_header(double: AdsDouble) -> None:
    with raw_socket(double) as link:
        link.sendall(raw_request(double, 2, struct.pack("<III", 0xF005, 12345, 4)))
        assert raw_reply(link)[2:] == (0, 77, struct.pack("<II", 0x710, 0))
        link.sendall(raw_request(double, 2, b"\0"))
        assert raw_reply(link)[4] == struct.pack("<II", 0x705, 0)
        link.sendall(raw_request(double, 99, b""))
        assert raw_reply(link)[4] == struct.pack("<I", 0x701)
        wrong_port = bytearray(raw_request(double, 4, b""))
        wrong_port[12:14] = struct.pack("<H", 801)
        link.sendall(wrong_port)
        assert receive(link, 38)[30:34] == struct.pack("<I", 6)


def test_raw_frames_may_be_split_or_joined(double: AdsDouble) -> None:
    with raw_socket(double) as link:
        for byte in raw_request(double, 4, b"", invoke=1):
            link.sendall(bytes([byte]))
        link.sendall(raw_request(double, 4, b"", invoke=2) + raw_request(double, 4, b"", invoke=3))
        assert [raw_reply(link)[3] for _ in range(3)] == [1, 2, 3]


def test_a_frame_with_wrong_lengths_closes_the_connection(double: AdsDouble) -> None:
    with raw_socket(double) as link:
        link.sendall(b"\xff" * 64)
        with pytest.raises(ConnectionResetError):
            link.recv(100)


def test_raw_notifications_are_streams_of_stamps(real: AdsDouble) -> None:
    name = f"{HEAD_NAME}.nNewest\0".encode()
    with raw_socket(real) as link:
        link.sendall(raw_request(real, 9, struct.pack("<IIII", 0xF003, 0, 4, len(name)) + name))
        handle = struct.unpack("<III", raw_reply(link)[4])[2]
        # cyclic (3), at most 50 ms late, every 5 ms; times in 100 ns
        wanted = struct.pack("<6I16x", 0xF005, handle, 8, 3, 500_000, 50_000)
        link.sendall(raw_request(real, 6, wanted))
        result, notification = struct.unpack("<II", raw_reply(link)[4])
        command, flags, error, _, data = raw_reply(link)
        assert (result, command, flags, error) == (0, 8, 4, 0)
        length, stamps = struct.unpack_from("<II", data)
        assert length == len(data) - 4
        assert stamps >= 10
        times, values = [], []
        for index in range(stamps):
            stamp, samples, owner, size, value = struct.unpack_from("<QIIIQ", data, 8 + index * 28)
            assert (samples, owner, size) == (1, notification, 8)
            times.append(stamp)
            values.append(value)
        assert np.diff(times) == pytest.approx(50_000, abs=3_000)
        assert list(np.unique(np.diff(values))) in ([5], [4, 5], [5, 6], [4, 5, 6])
        assert times[-1] / 1e7 - 11_644_473_600 == pytest.approx(time.time(), abs=2)
        link.sendall(raw_request(real, 7, struct.pack("<I", notification), invoke=80))
        while (reply := raw_reply(link))[0] == 8:
            pass
        assert (reply[3], reply[4]) == (80, b"\0\0\0\0")


# --- structured text -------------------------------------------------------------------------------

TWINCAT = Path(__file__).parents[2] / "docs" / "twincat"
IEC_TYPES = {"UINT": "<u2", "UDINT": "<u4", "ULINT": "<u8", "REAL": "<f4", "INT": "<i2"}


def declared_fields(name: str, frames: int) -> np.dtype[Any]:
    """The packed structure that `name`.st declares."""
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    text = (TWINCAT / f"{name}.st").read_text().replace("(GVL_AcqdConst.cFrames - 1)", str(frames - 1))
    for field, _, bounds, kind in re.findall(r"^\s+(\w+)\s*:\s*(ARRAY\[(.*?)\] OF )?(\w+);", text, re.MULTILINE):
        shape = tuple(int(last) + 1 for last in re.findall(r"0\.\.(\d+)", bounds))
        fields.append((field, IEC_TYPES[kind], shape))
    return np.dtype(fields)


@pytest.mark.parametrize("frames", [20, 100])
def test_the_structured_text_declares_the_same_layout(frames: int) -> None:
    assert declared_fields("ST_AcqdHead", frames) == HEAD
    assert declared_fields("ST_AcqdSlot", frames) == slot_dtype(frames)
    assert (HEAD.itemsize, slot_dtype(frames).itemsize) == (64, 40 + 12 * frames)


# --- clock and process ---------------------------------------------------------------------------


def test_the_real_clock_drifts_as_told() -> None:
    with AdsDouble(Settings(unused_host(), clock="real", drift_ppm=500_000)) as server:
        client = Client(server.settings.host)
        start, first = time.monotonic(), client.newest()
        time.sleep(0.2)
        last, end = client.newest(), time.monotonic()
        client.ads.close()
        assert 1500 * 0.2 - 2 <= last - first <= 1500 * (end - start) + 2


def test_pyads_releases_the_interpreter_lock_while_it_waits(client: Client, double: AdsDouble) -> None:
    double.command(latency_s=0.2)

    def rounds() -> int:
        """Of this thread, while another waits for an answer."""
        reader = threading.Thread(target=client.ads.read_state)
        reader.start()
        count = 0
        while reader.is_alive():
            time.sleep(0.001)
            count += 1
        return count

    wait_for(lambda: rounds() > 20, "the interpreter works meanwhile")


def test_the_process_takes_commands_and_ends_with_its_input() -> None:
    host = unused_host()
    with AdsProcess(host, clock="lockstep", frames=10, phases=2, advance=7) as process:
        client = Client(host)
        head = client.head()
        assert (head[3], head[5], head[6], head[-1]) == (40 + 12 * 10, 4, 10, 7)
        assert process.command(latency_s=0.0) == {"ok": True}
        assert process.stats()["newest"] == 7
        with pytest.raises(RuntimeError, match="unknown command: nonsense"):
            process.command(nonsense=1)
        with pytest.raises(RuntimeError, match="channel"):
            process.command(status=1)
        client.ads.close()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((host, 48898), timeout=1)


def test_the_process_reports_readiness_and_quits_on_command() -> None:
    run = subprocess.run(
        [sys.executable, "-m", "tests.doubles.ads", "--host", unused_host()],
        input='not json\n{"quit": true}\n{"stats": true}\n', capture_output=True, text=True, timeout=20, check=True,
    )  # fmt: skip
    lines = run.stdout.splitlines()
    assert lines[0] == '{"ready": true}'
    assert '"error"' in lines[1]
    assert lines[2:] == ['{"ok": true}']
