"""Answers are found among stray bytes, echoes, late answers and headers of gateways."""

from __future__ import annotations

import contextlib
import itertools
import logging
import os
import pty
import select
import socket
import struct
import threading
import tty

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymodbus.framer.rtu import FramerRTU
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadInputRegistersRequest

from acqd.sources.modbus import ModbusLink
from acqd.sources.modbus.client import ModbusClient, ModbusError
from acqd.sources.modbus.framing import LenientSocket, Line, ResyncRtu


def sealed(body: bytes) -> bytes:
    crc = 0xFFFF
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return body + struct.pack("<H", crc)


def answer(unit: int, values: list[int]) -> bytes:
    return sealed(bytes([unit, 4, 2 * len(values)]) + b"".join(struct.pack(">H", value) for value in values))


def rtu(unit: int = 1, count: int = 2, **line: bool) -> tuple[ResyncRtu, bytes]:
    framer = ResyncRtu(DecodePDU(False), Line("line", **line))
    return framer, framer.buildFrame(ReadInputRegistersRequest(address=7, count=count, dev_id=unit))


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=40), st.binary(max_size=10), st.booleans())
def test_a_frame_is_found_behind_any_bytes(before, after, echoed):
    framer, request = rtu()
    wire = (request if echoed else b"") + before + answer(1, [230, 50]) + after
    used, found = framer.handleFrame(wire, 1, 0)
    assert found is not None and used == len(wire) and found.registers == [230, 50]


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=60))
def test_noise_is_no_answer_and_no_crash(noise):
    framer, _ = rtu()
    _, found = framer.handleFrame(noise, 1, 0)
    assert found is None or sealed(noise[:-2]) == noise
    LenientSocket(DecodePDU(False), Line("x")).handleFrame(noise, 1, 1)


def test_every_byte_of_an_answer_counts():
    whole = answer(1, [230, 50])
    for end in range(len(whole)):
        framer, _ = rtu()
        assert framer.handleFrame(whole[:end], 1, 0) == (0, None)
    for at in range(len(whole)):
        framer, _ = rtu()
        broken = whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :]
        assert framer.handleFrame(broken, 1, 0)[1] is None


def test_answers_of_other_units_functions_and_lengths_are_passed_over():
    framer, _ = rtu(unit=3)
    others = answer(2, [1, 2]) + answer(3, [1]) + answer(3, [1, 2, 3]) + sealed(bytes([3, 3, 4, 0, 1, 0, 2]))
    assert framer.handleFrame(others, 3, 0)[1] is None
    assert framer.handleFrame(others + answer(3, [8, 9]), 3, 0)[1].registers == [8, 9]
    assert rtu(unit=3)[0].handleFrame(b"\0" + sealed(bytes([3, 0x84, 2])), 3, 0)[1].exception_code == 2


@pytest.mark.parametrize("late", [False, True])
def test_an_answer_for_which_nobody_asked_is_named_once(late, caplog):
    framer, _ = rtu()
    if late:  # that of an earlier request, before the one to this request
        assert framer.handleFrame(answer(1, [1, 2, 3]) + answer(1, [8, 9]), 1, 0)[1].registers == [8, 9]
    else:
        assert framer.handleFrame(answer(1, [8, 9]), 1, 0)[1].registers == [8, 9]
    assert framer.handleFrame(answer(1, [8, 9]), 1, 0)[1] is None
    assert [record.message.partition(";")[0] for record in caplog.records] == ["line: answers come twice or late"]


def test_the_crc_is_that_of_pymodbus():
    body = bytes(range(20))
    assert sealed(body)[-2:] == FramerRTU.compute_CRC(body).to_bytes(2, "big")


class Meter:
    """One meter on a pseudo terminal; `reply(request, number)` gives (delay, bytes) pairs."""

    def __init__(self, reply):
        self.master, self._slave = pty.openpty()
        tty.setraw(self.master)
        tty.setraw(self._slave)
        self.path, self._reply, self.asked = os.ttyname(self._slave), reply, 0
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self):
        while True:
            try:
                if not select.select([self.master], [], [], 30)[0]:
                    return
                request = os.read(self.master, 256)
            except (OSError, ValueError):  # closed
                return
            number, self.asked = self.asked, self.asked + 1
            for delay, frame in self._reply(request, number):
                threading.Timer(delay, self._write, (frame,)).start()

    def _write(self, frame):
        with contextlib.suppress(OSError):  # closed meanwhile
            os.write(self.master, frame)

    def close(self):
        master, self.master = self.master, -1  # a late answer must not reach who gets the number next
        os.close(master)


def registers(request: bytes) -> bytes:
    first, count = struct.unpack(">HH", request[2:6])
    return answer(request[0], list(range(first, first + count)))


@pytest.mark.parametrize("shape", ["plain", "zero before", "echo", "echo cut", "two pieces"])
def test_a_meter_on_a_bad_line_is_read(shape):
    def reply(request, _number):
        frame = registers(request)
        return {
            "plain": [(0, frame)], "zero before": [(0, b"\0\xff" + frame)], "echo": [(0, request + frame)],
            "echo cut": [(0, request[:5]), (0.05, request[5:] + frame)], "two pieces": [(0, frame[:4]), (0.05, frame[4:])],  # noqa: E501
        }[shape]  # fmt: skip

    meter = Meter(reply)
    client = ModbusClient(
        ModbusLink(serial_port=meter.path, baudrate=115_200, timeout_s=30.0, echo=shape == "echo cut")
    )
    for first in (0, 10, 20):
        [data] = client.read(1, [(4, first, 3)])
        assert struct.unpack(">3H", data) == (first, first + 1, first + 2)
    client.close()
    meter.close()


def test_an_answer_that_comes_late_is_not_the_answer_to_the_next_request():
    def reply(request, number):
        return [(0.45 if number == 0 else 0.0, registers(request))]  # the first after its time-out

    meter = Meter(reply)
    client = ModbusClient(ModbusLink(serial_port=meter.path, baudrate=115_200, timeout_s=0.2))
    with pytest.raises(ModbusError, match="does not answer"):
        client.read(1, [(4, 0, 3)])
    for first in (100, 200, 300):
        [data] = patiently(client, [(4, first, 3)])
        assert struct.unpack(">3H", data)[0] == first
    client.close()
    meter.close()


def patiently(client, reads, pause_s=0.0):
    """What unit 1 answers: a machine that stalls makes a time-out, and whoever polls asks again."""
    for _ in range(20):
        with contextlib.suppress(ModbusError):
            return client.read(1, reads, pause_s)
    raise AssertionError("no answer")


@pytest.mark.parametrize("delay", [0.001, 0.006, 0.02])
@pytest.mark.parametrize("counts", [(2, 2, 2, 2), (6, 4, 6)])
def test_a_slave_that_answers_twice_shifts_no_read(delay, counts, caplog):
    """The second answer comes between requests, together with the next request, or after it."""

    def reply(request, _number):
        return [(0.004, registers(request)), (0.004 + delay, registers(request))]

    meter = Meter(reply)
    client = ModbusClient(ModbusLink(serial_port=meter.path, baudrate=115_200, timeout_s=0.1))
    for turn in range(3):
        reads = [(4, 100 * k + turn, count) for k, count in enumerate(counts, start=1)]
        answers = patiently(client, reads, 0.005)
        assert [struct.unpack(">H", data[:2])[0] for data in answers] == [first for _, first, _ in reads]
    assert {record.message.partition(";")[0] for record in caplog.records} <= {
        f"{client.link}: answers come twice or late"
    }
    client.close()
    meter.close()


def test_a_round_without_a_load_is_read_as_often_as_it_needs():
    """Equal answers of equal length may be one answer twice: the second read is repeated, and that of 0 is no copy."""
    meter = Meter(lambda request, _: [(0.0, answer(1, [0] * struct.unpack(">H", request[4:6])[0]))])
    client = ModbusClient(ModbusLink(serial_port=meter.path, baudrate=115_200, timeout_s=30.0))
    assert client.read(1, [(4, 0, 2), (4, 8, 2), (4, 20, 3)]) == [bytes(4), bytes(4), bytes(6)]
    assert meter.asked == 4
    client.close()
    meter.close()


def gateway(change, opened=lambda: None):
    """A TCP server that changes transaction id and unit of its answers; `opened` with every connection."""
    server = socket.create_server(("127.0.0.1", 0))

    numbers = itertools.count()

    def serve(peer):
        opened()
        while data := peer.recv(260):
            number = next(numbers)
            tid, _, _, unit = struct.unpack(">HHHB", data[:7])
            first, count = struct.unpack(">HH", data[8:12])
            body = bytes([data[7], 2 * count]) + b"".join(struct.pack(">H", first + k) for k in range(count))
            for new_tid, new_unit, payload in change(number, tid, unit, body):
                peer.sendall(struct.pack(">HHHB", new_tid & 0xFFFF, 0, len(payload) + 1, new_unit) + payload)

    def run():
        with contextlib.suppress(OSError):
            while True:
                serve(server.accept()[0])

    threading.Thread(target=run, daemon=True).start()
    return server


@pytest.mark.parametrize(
    ("change", "said"),
    [(lambda n, t, u, b: [(t, 0, b)], "answers with unit 0 for unit 5"),
     (lambda n, t, u, b: [(0x7000 + n, u, b)], "transaction ids of its own"),
     (lambda n, t, u, b: [(0, 255, b)], "transaction ids of its own")],
)  # fmt: skip
def test_a_gateway_with_ideas_of_its_own_is_understood_and_named_once(change, said, caplog):
    server = gateway(change)
    client = ModbusClient(ModbusLink("127.0.0.1", server.getsockname()[1], timeout_s=30.0))
    with caplog.at_level(logging.WARNING):
        for first in (0, 10, 20):
            [data] = client.read(5, [(4, first, 2)])
            assert struct.unpack(">2H", data) == (first, first + 1)
    assert [said in record.message for record in caplog.records].count(True) == 1
    client.close()
    server.close()


def reads_after_a_late_answer(server):
    """The second of four reads is answered late; the later ones get their own registers."""
    client = ModbusClient(ModbusLink("127.0.0.1", server.getsockname()[1], timeout_s=0.8))
    client.read(5, [(4, 0, 2)])
    with pytest.raises(ModbusError):
        client.read(5, [(4, 10, 2)])
    for first in (20, 30):
        [data] = client.read(5, [(4, first, 2)])
        assert struct.unpack(">2H", data)[0] == first
    client.close()
    server.close()


def test_an_answer_to_an_earlier_request_is_passed_over_by_its_transaction_id():
    held = []

    def late(number, tid, unit, body):
        if number == 1:
            held.append((tid, unit, body))
            return []
        return [*held, (tid, unit, body)] if number == 2 else [(tid, unit, body)]

    server = gateway(late)
    reads_after_a_late_answer(server)


@pytest.mark.parametrize("own", [lambda n, t: 0x7000 + n, lambda n, t: 0])
def test_a_late_answer_of_a_gateway_with_ids_of_its_own_shifts_no_read(own):
    held = []

    def late(number, tid, unit, body):
        if number == 1:
            held.append((own(number, tid), unit, body))
            return []
        return [*held, (own(number, tid), unit, body)]

    server = gateway(late, held.clear)
    reads_after_a_late_answer(server)


def test_a_gateway_that_passes_rtu_frames_on_is_read_with_its_framing():
    server = socket.create_server(("127.0.0.1", 0))

    def run():
        peer = server.accept()[0]
        while frame := peer.recv(260):
            first, count = struct.unpack(">HH", frame[2:6])
            body = bytes([frame[0], frame[1], 2 * count]) + b"".join(struct.pack(">H", first + k) for k in range(count))
            peer.sendall(b"\xff" + sealed(body))  # with a stray byte

    threading.Thread(target=run, daemon=True).start()
    client = ModbusClient(ModbusLink("127.0.0.1", server.getsockname()[1], timeout_s=30.0, framing="rtu"))
    for first, count in ((0, 2), (10, 3)):
        [data] = client.read(5, [(4, first, count)])
        assert struct.unpack(f">{count}H", data) == tuple(range(first, first + count))
    client.close()
    server.close()
