"""Modbus TCP server (Modbus Messaging on TCP/IP V1.0b): MBAP header, several clients, pipelined requests."""

from __future__ import annotations

import asyncio
import socket
import struct
import threading
from collections.abc import Callable, Mapping
from types import TracebackType

from tests.doubles.modbus.bank import RegisterBank
from tests.doubles.modbus.base import ModbusDouble

_MBAP = struct.Struct(">HHHB")
_LONGEST_PDU = 253


class _Connection(asyncio.Protocol):
    """One client. A header that is none of Modbus ends the connection: nothing after it could be understood."""

    transport: asyncio.Transport

    def __init__(self, double: ModbusTcpDouble) -> None:
        self._double = double
        self._buffer = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._double._connections.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        self._double._connections.discard(self)

    def data_received(self, data: bytes) -> None:
        buffer = self._buffer + data
        answers = []
        while len(buffer) >= _MBAP.size:
            transaction, protocol, length, unit = _MBAP.unpack_from(buffer)
            if protocol != 0 or not 2 <= length <= _LONGEST_PDU + 1:
                self.abort()
                return
            if len(buffer) < 6 + length:
                break
            answers.append(self._double._answer(transaction, unit, buffer[7 : 6 + length]))
            buffer = buffer[6 + length :]
        self._buffer = buffer
        if out := b"".join(answers):
            self._send(out)

    def _send(self, out: bytes) -> None:
        if self._double.latency_s:
            asyncio.get_running_loop().call_later(self._double.latency_s, self.transport.write, out)
        else:
            self.transport.write(out)

    def abort(self) -> None:
        """Close with RST: lingering for 0 s discards what is unsent."""
        sock = self.transport.get_extra_info("socket")
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.transport.abort()


class ModbusTcpDouble(ModbusDouble):
    """Modbus TCP server in a thread: `with ModbusTcpDouble({1: bank}) as double: double.port`.

    A unit that is not there answers with exception 0x0B, as a gateway does.
    """

    gateway = True

    def __init__(self, units: Mapping[int, RegisterBank], host: str = "127.0.0.1", port: int = 0) -> None:
        super().__init__(units)
        self.host = host
        self.port = port
        self._connections: set[_Connection] = set()
        self._loop = asyncio.new_event_loop()
        self._server: asyncio.Server | None = None
        self._reopening: asyncio.Task[None] | None = None
        self._thread = threading.Thread(target=self._loop.run_forever, name="modbus tcp double", daemon=True)

    def __enter__(self) -> ModbusTcpDouble:
        self._thread.start()
        try:
            asyncio.run_coroutine_threadsafe(self._listen(), self._loop).result()
        except OSError:
            self._stop_loop()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._call(self._close)
        self._stop_loop()

    def _stop_loop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _listen(self) -> None:
        self._server = await self._loop.create_server(lambda: _Connection(self), self.host, self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    def _close(self) -> None:
        if self._server is not None:
            self._server.close()
            self._server = None
        self._abort_all()

    def _abort_all(self) -> None:
        for connection in tuple(self._connections):
            connection.abort()

    def _call(self, function: Callable[[], None]) -> None:
        """Run in the loop's thread and wait for it: what a test does next happens after it."""

        async def run() -> None:
            function()
            await asyncio.sleep(0)  # a transport closes its socket one turn of the loop after abort()

        asyncio.run_coroutine_threadsafe(run(), self._loop).result()

    @property
    def connections(self) -> int:
        """Clients connected now."""
        return len(self._connections)

    def reset_connections(self) -> None:
        """Close each connection with RST; clients may connect again at once."""
        self._call(self._abort_all)

    def refuse(self, seconds: float) -> None:
        """Reset each connection and refuse new ones for `seconds`."""
        self._call(self._close)
        self._loop.call_soon_threadsafe(self._loop.call_later, seconds, self._listen_again)

    def _listen_again(self) -> None:
        self._reopening = self._loop.create_task(self._listen())

    def _answer(self, transaction: int, unit: int, pdu: bytes) -> bytes:
        """The whole frame; empty where the unit is silent."""
        self._note(unit, pdu)
        if (reply := self._respond(unit, pdu)) is None:
            return b""
        if not self._damages:
            return _MBAP.pack(transaction, 0, len(reply) + 1, unit) + reply
        reply, damage = self._damaged(unit, reply)
        wrong = transaction ^ 0x5555 if damage == "garbage" else transaction
        frame = _MBAP.pack(wrong, 0, len(reply) + 1, unit) + reply
        return frame[: len(frame) // 2] if damage == "cut" else frame
