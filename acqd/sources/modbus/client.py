"""Registers through pymodbus: several connections at once, answers as bytes, one kind of error."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import termios
import time
from collections import deque
from pathlib import Path
from typing import Any, TypeAlias

import serial
from pymodbus import FramerType
from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
from pymodbus.exceptions import ModbusException
from pymodbus.pdu import ModbusPDU
from pymodbus.pdu.register_message import ReadHoldingRegistersResponse, ReadInputRegistersResponse

from acqd.errors import UserError
from acqd.sources.modbus.framing import LenientSocket, Line, ResyncAscii, ResyncRtu
from acqd.sources.modbus.settings import ModbusLink
from acqd.sources.remote_ring import DeviceError

logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # each error comes back as an exception and is reported once

_EXCEPTIONS = {
    1: "the device does not know this function code",
    2: "the device has no such register",
    3: "the device refuses that many registers",
    4: "the device has a fault",
    6: "the device is busy",
    10: "the gateway cannot reach the unit",
    11: "the unit behind the gateway does not answer",
}
ILLEGAL_ADDRESS = 2
_LONGEST_ANSWER = 5 + 2 * 125  # bytes
_LATE = 3.0  # times its time-out an answer may take and still be one: the unit is not asked before
_BITS = 11  # of a character on a serial line
_LEAST_SILENCE_S = 0.00175  # between two frames, at any baud rate (Modbus over Serial Line, 2.5.1.1)
_UNUSABLE = (OSError, ValueError, termios.error)
"""What opening a connection may raise; a name with wrong characters is a UnicodeError, which is a ValueError."""
_RECENT = 16  # answers that may come once more
_FRAMERS = {FramerType.SOCKET: LenientSocket, FramerType.RTU: ResyncRtu, FramerType.ASCII: ResyncAscii}
Read: TypeAlias = tuple[int, int, int]
"""Function code, first register, number of registers."""


class _RawHolding(ReadHoldingRegistersResponse):
    """Keeps the registers as bytes: unpacking them one by one would cost more than the rest of the read."""

    payload = b""

    def decode(self, data: bytes) -> None:
        self.payload = data[1 : 1 + data[0]]


class _RawInput(ReadInputRegistersResponse):
    payload = b""

    def decode(self, data: bytes) -> None:
        self.payload = data[1 : 1 + data[0]]


class ModbusError(DeviceError):
    """A device that does not answer as it should; one line."""

    def __init__(self, message: str, code: int | None = None) -> None:
        """`code` of the Modbus exception, None for silence or a lost connection."""
        super().__init__(message)
        self.code = code


class NoConnectionError(ModbusError):
    """Nobody listens at the link's address, or its port cannot be opened."""


def _why_not(link: ModbusLink) -> str:
    """What the operating system says of a connection that pymodbus could not make."""
    try:
        if link.host:
            socket.create_connection((link.host, link.port), timeout=link.timeout_s).close()
        else:
            _open(link, link.serial_port or "").close()
    except _UNUSABLE as error:
        return str(getattr(error, "strerror", None) or error)
    return "it was refused a moment ago"


class ModbusClient:
    """Reads registers of one link; its event loop runs only while a read is under way."""

    def __init__(self, link: ModbusLink, connections: int = 1) -> None:
        """Raises UserError for a serial port that cannot be used."""
        if link.serial_port is not None:
            _check_serial(link, link.serial_port)
        self.link = link
        self._line = Line(str(link), link.echo)
        self._late: dict[int, float] = {}  # until when the answer to a request that timed out may still come
        self._recent: deque[tuple[int, Read, bytes]] = deque(maxlen=_RECENT)  # unit, read and answer
        self._loop = asyncio.new_event_loop()
        self._clients: list[Any] = []
        self._connections = 1 if link.is_serial else connections

    def read(self, unit: int, reads: list[Read], pause_s: float = 0.0) -> list[bytes]:
        """The registers of each read, big-endian as on the wire; `pause_s` of silence [s] before each request on
        a serial line.

        Raises ModbusError at the first that fails.
        """
        return self._loop.run_until_complete(self._read(unit, reads, pause_s))

    def close(self) -> None:
        """Drop all connections."""
        for client in self._clients:
            client.close()
        self._clients = []
        left = asyncio.all_tasks(self._loop)  # of a read that Ctrl-C has broken off
        for task in left:
            task.cancel()
        self._loop.run_until_complete(_ended(left))
        self._loop.close()

    async def _read(self, unit: int, reads: list[Read], pause_s: float) -> list[bytes]:
        await self._connect()
        answers: list[bytes] = [b""] * len(reads)
        queue = iter(enumerate(reads))

        async def work(client: Any) -> None:
            for number, (function, address, count) in queue:
                if pause_s and self.link.is_serial:  # a gateway keeps the silence of its serial line itself
                    await asyncio.sleep(pause_s)
                answers[number] = await self._ask(client, unit, (function, address, count))

        workers = [asyncio.ensure_future(work(client)) for client in self._clients[: len(reads)]]
        try:
            await asyncio.gather(*workers)
        finally:
            for worker in workers:
                worker.cancel()
        return answers

    async def _ask(self, client: Any, unit: int, read: Read) -> bytes:
        """One read. On a serial line nothing names the request that an answer is for.

        So what still comes is left to pass before a request, and after a time-out the unit is asked again only when its
        late answer has passed. A gateway with transaction ids of its own names no request either: its late answers end
        with the connection.
        """
        if self.link.is_serial:
            await asyncio.sleep(max(0.0, self._late.pop(unit, 0.0) - time.monotonic()))
            await self._silence(client)
        begun = time.monotonic()
        try:
            answer = await _one(client, unit, *read)
            if self.link.is_serial and self._like_another(unit, read, answer):
                answer = await self._again(client, unit, read, answer)
            self._recent.append((unit, read, answer))
            return answer
        except ModbusError as error:
            if error.code is None and self.link.is_serial:
                self._late[unit] = begun + _LATE * max(time.monotonic() - begun, self.link.timeout_s)
            elif error.code is None and not self._line.exact:
                client.close()
            raise

    def _like_another(self, unit: int, read: Read, answer: bytes) -> bool:
        """Whether this may be an earlier answer once more: the same bytes for other registers of one unit."""
        return any(
            read != earlier and (unit, read[0], read[2], answer) == (other, earlier[0], earlier[2], payload)
            for other, earlier, payload in self._recent
        )

    async def _again(self, client: Any, unit: int, read: Read, first: bytes) -> bytes:
        """The answer of a second read; where it differs from the first, that of a third on a line that is silent."""
        second = await _one(client, unit, *read)
        if second == first:
            return first
        self._line.unsettled = True
        if any(first):  # a load that was just switched on looks the same where all was 0
            self._line.repeated()
        await self._silence(client)
        return await _one(client, unit, *read)

    async def _silence(self, client: Any) -> None:
        """Wait until the line has nothing more to say; the system has kept what came since the last read."""
        framer, line = client.ctx.framer, self._line
        heard, end = framer.heard, time.monotonic() + _LATE * self.link.timeout_s
        for _ in range(2):  # turns of the loop: the first finds that bytes wait, the second reads them
            await asyncio.sleep(0)
        framer.timing = True
        pause_s = max(framer.pause_left_s(), self.link.timeout_s if line.unsettled else 0.0)
        if pause_s > 0:
            await asyncio.sleep(pause_s)
        if line.unsettled:  # all that may come has come, and how late is known
            line.unsettled, line.pause_s = False, max(line.pause_s, _LEAST_SILENCE_S)
        while heard != framer.heard and time.monotonic() < end:
            heard = framer.heard
            await asyncio.sleep(max(_LEAST_SILENCE_S, 3.5 * _BITS / self.link.baudrate))
        framer.timing = False

    async def _connect(self) -> None:
        if self._clients and all(client.connected for client in self._clients):
            return
        for client in self._clients:
            client.close()
        self._clients = [_make(self.link, self._line) for _ in range(self._connections)]
        try:
            connected = all(await asyncio.gather(*(client.connect() for client in self._clients)))
        except _UNUSABLE:
            connected = False
        if not connected:
            raise NoConnectionError(f"no connection ({_why_not(self.link)}); check address, cable and power")


async def _ended(tasks: set[asyncio.Task[Any]]) -> None:
    """Let cancelled tasks and closed transports come to their end."""
    await asyncio.gather(*tasks, asyncio.sleep(0), return_exceptions=True)


async def _one(client: Any, unit: int, function: int, address: int, count: int) -> bytes:
    method = client.read_holding_registers if function == 3 else client.read_input_registers
    try:
        answer: ModbusPDU = await method(address, count=count, device_id=unit)
    except (TimeoutError, ModbusException, OSError):
        raise ModbusError(f"unit {unit} does not answer") from None
    if answer.isError():
        code = int(getattr(answer, "exception_code", 0))
        meaning = _EXCEPTIONS.get(code, "the device refuses")
        raise ModbusError(f"unit {unit}, register {address}: {meaning} (exception {code})", code)
    payload: bytes = getattr(answer, "payload", b"")
    if len(payload) != 2 * count:
        raise ModbusError(f"unit {unit}, register {address}: {len(payload)} bytes, expected {2 * count}")
    return payload


def _make(link: ModbusLink, line: Line) -> Any:
    client: Any
    # the longest question and answer take their time on a serial line
    on_line_s = link.characters * (8 + _LONGEST_ANSWER) * _BITS / link.baudrate if link.is_serial else 0.0
    kind = FramerType.ASCII if link.framing == "ascii" else FramerType.RTU if link.is_serial else FramerType.SOCKET
    if link.host:
        client = AsyncModbusTcpClient(
            link.host,
            framer=kind,
            port=link.port,
            timeout=link.timeout_s + on_line_s,
            retries=0,
            reconnect_delay=0,
        )
    else:
        client = AsyncModbusSerialClient(
            link.serial_port or "",
            framer=kind,
            baudrate=link.baudrate,
            bytesize=link.databits,
            parity=link.parity,
            stopbits=link.stopbits,
            timeout=link.timeout_s + on_line_s,
            retries=0,
            reconnect_delay=0,
        )
    client.ctx.framer = _FRAMERS[kind](client.ctx.framer.decoder, line)
    client.register(_RawHolding)
    client.register(_RawInput)
    return client


def _open(link: ModbusLink, port: str) -> serial.Serial:
    """The port as pymodbus will open it. Raises OSError, ValueError or termios.error."""
    return serial.Serial(
        port, link.baudrate, bytesize=link.databits, parity=link.parity, stopbits=link.stopbits, exclusive=True
    )


def _check_serial(link: ModbusLink, port: str) -> None:
    """Say what is wrong with a serial port before pymodbus only says that it cannot connect."""
    if not Path(port).exists():
        raise UserError(f"source.serial_port: there is no {port}; plug the adapter in, or see ls /dev/tty*")
    try:
        _open(link, port).close()
    except serial.SerialException as error:
        if "lock" in str(error):
            raise UserError(f"source.serial_port: {port} is in use by another program; stop that one") from None
        why = os.strerror(error.errno) if error.errno else error  # its text repeats the name of the port
        raise UserError(
            f"source.serial_port: {port} cannot be opened ({why}); add the service's user to the group dialout"
        ) from None
    except (termios.error, ValueError):
        raise UserError(
            f"source.serial_port: {port} does not take {link.baudrate} Bd {link.databits}{link.parity}{link.stopbits}; "
            "check baudrate, databits, parity and stopbits, or take another adapter"
        ) from None
