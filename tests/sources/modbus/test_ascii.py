"""Modbus ASCII: frames as text, against the server of pymodbus at the other end of a pseudo terminal."""

from __future__ import annotations

import asyncio
import contextlib
import os
import pty
import select
import struct
import termios
import threading
import tty

import pytest
import serial
from pydantic import ValidationError
from pymodbus.framer.ascii import FramerAscii
from pymodbus.framer.base import FramerType
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadInputRegistersRequest
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

from acqd.daemon.modbus_sections import MetersSection
from acqd.errors import UserError
from acqd.sources.modbus import ModbusLink
from acqd.sources.modbus.client import ModbusClient, ModbusError
from acqd.sources.modbus.framing import Line, ResyncAscii

VALUES = list(range(1000, 1120))


def framed(body: bytes) -> bytes:
    return FramerAscii(DecodePDU(False)).encode(body[1:], body[0], 0)


def answer(unit: int, values: list[int]) -> bytes:
    return framed(bytes([unit, 4, 2 * len(values)]) + b"".join(struct.pack(">H", value) for value in values))


@pytest.fixture
def framer():
    made = ResyncAscii(DecodePDU(False), Line("line"))
    made.request = made.buildFrame(ReadInputRegistersRequest(address=7, count=2, dev_id=1))
    return made


@pytest.mark.parametrize(
    "before", [b"", b"\0\xff", b":0104", b":::", b"\r\n", answer(2, [1, 2]), answer(1, [1]), "echo"]
)
def test_an_answer_is_found_behind_any_bytes(framer, before):
    wire = framer.request if before == "echo" else before
    for spelling in (answer(1, [230, 50]), answer(1, [230, 50]).lower()):
        framer.buildFrame(ReadInputRegistersRequest(address=7, count=2, dev_id=1))
        used, found = framer.handleFrame(wire + spelling, 1, 0)
        assert found is not None and found.registers == [230, 50] and used == len(wire + spelling)


def test_every_character_of_an_answer_counts(framer):
    whole = answer(1, [230, 50])
    for end in range(len(whole)):
        assert framer.handleFrame(whole[:end], 1, 0) == (0, None)
    for at in range(len(whole)):
        broken = whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :]
        assert framer.handleFrame(broken, 1, 0)[1] is None
    assert framer.handleFrame(framed(bytes([1, 0x84, 2])), 1, 0)[1].exception_code == 2


def test_registers_of_a_server_of_pymodbus():
    near, far = pty.openpty(), pty.openpty()
    for end in (*near, *far):
        tty.setraw(end)
    stop, ready = threading.Event(), threading.Event()
    holder: list[object] = []

    def bridge():
        masters = near[0], far[0]
        while not stop.is_set():
            for end in select.select(masters, [], [], 0.05)[0]:
                os.write(masters[1 - masters.index(end)], os.read(end, 1024))

    async def serve():
        device = SimDevice(7, simdata=[SimData(0, values=VALUES, datatype=DataType.REGISTERS)])
        server = ModbusSerialServer(device, framer=FramerType.ASCII, port=os.ttyname(far[1]), baudrate=115_200)
        await server.listen()
        holder.extend((asyncio.get_running_loop(), server))
        ready.set()
        with contextlib.suppress(asyncio.CancelledError):
            await server.serving

    threads = [threading.Thread(target=bridge), threading.Thread(target=lambda: asyncio.run(serve()))]
    for thread in threads:
        thread.start()
    assert ready.wait(30)
    link = ModbusLink(serial_port=os.ttyname(near[1]), baudrate=115_200, timeout_s=10.0, framing="ascii")
    client = ModbusClient(link)
    try:
        answers = client.read(7, [(4, 0, 2), (3, 5, 100), (4, 119, 1)])
        assert [list(struct.unpack(f">{len(data) // 2}H", data)) for data in answers] == [
            VALUES[:2], VALUES[5:105], VALUES[119:]
        ]  # fmt: skip
        with pytest.raises(ModbusError, match="no such register"):
            client.read(7, [(4, 500, 1)])
    finally:
        client.close()
        loop, server = holder
        asyncio.run_coroutine_threadsafe(server.shutdown(), loop).result(30)  # type: ignore[attr-defined, arg-type]
        stop.set()
        for thread in threads:
            thread.join(30)
        for end in (*near, *far):
            os.close(end)


def test_an_adapter_that_does_not_take_the_characters_is_named(monkeypatch):
    def refused(*_arguments, **_settings):
        raise termios.error(22, "Invalid argument")  # of a pseudo terminal with 7 bits

    monkeypatch.setattr(serial, "Serial", refused)
    with pytest.raises(UserError, match="does not take 9600 Bd 7E1"):
        ModbusClient(ModbusLink(serial_port="/dev/null", framing="ascii", databits=7, parity="E"))


def test_seven_bits_are_refused_where_bytes_are_binary():
    keys = {"kind": "meters", "meters": [{"name": "m", "profile": "em340"}]}
    MetersSection(**keys, serial_port="/dev/ttyS0", framing="ascii", databits=7)
    MetersSection(**keys, host="gateway", framing="ascii")
    for wrong in ({"databits": 7}, {"framing": "rtu"}):
        with pytest.raises(ValidationError, match="ascii"):
            MetersSection(**keys, serial_port="/dev/ttyS0", **wrong)
