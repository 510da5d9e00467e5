"""A connected socket on the running event loop: written at once where possible, read in large pieces."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import ssl
import threading
import time
from collections.abc import Callable

from acqd.errors import UserError
from acqd.telemetry.mqtt import BrokerAddress, dial, pending

_PIECE = 1 << 16
_GATHERED = 64
"""Bytes that wake a socket that gathers: several acknowledgements, or any message of a sink."""
_BUSY = (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError)
Socket = socket.socket | ssl.SSLSocket


class LoopSocket:
    """`on_data` gets what arrives, `on_end` the reason when nothing more can come or go."""

    def __init__(self, sock: Socket, on_data: Callable[[bytes], None], on_end: Callable[[str], None]) -> None:
        self._loop = asyncio.get_running_loop()
        self._socket, self._on_data, self._on_end = sock, on_data, on_end
        self._out = bytearray()
        self._ended = False
        self.sent_at = self.heard_at = time.monotonic()
        """When the socket has last taken and given something (monotonic) [s]."""
        self._loop.add_reader(sock, self._read)

    def write(self, data: bytes) -> None:
        """Send now what the socket takes, and the rest when it takes more."""
        if self._ended:
            return
        if self._out:
            self._out += data
            return
        sent = self._send(data)
        if sent < len(data) and not self._ended:
            self._out += data[sent:]
            self._loop.add_writer(self._socket, self._write_rest)

    def gather(self) -> None:
        """From now on, a few bytes wake nobody: `hear` takes them. A turn of the event loop for each acknowledgement
        would cost a tenth of what a window does. The end of the connection wakes as before.
        """
        with contextlib.suppress(OSError):  # without it, everything wakes
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, _GATHERED)

    def hear(self) -> None:
        """Take what has arrived."""
        if not self._ended:
            self._read()

    def end(self, reason: str) -> None:
        """Read and write no more."""
        if not self._ended:
            self._ended = True
            if self._socket.fileno() >= 0:
                self._loop.remove_reader(self._socket)
                self._loop.remove_writer(self._socket)
            self._on_end(reason)

    def close(self) -> None:
        """End, and close the socket."""
        self.end("closed")
        self._socket.close()

    def _write_rest(self) -> None:
        del self._out[: self._send(self._out)]
        if not self._out and not self._ended:
            self._loop.remove_writer(self._socket)

    def _send(self, data: bytes | bytearray) -> int:
        """Bytes that the socket has taken."""
        try:
            sent = self._socket.send(data)
        except _BUSY:
            return 0
        except (OSError, ValueError) as error:
            self.end(in_words(error))
            return 0
        self.sent_at = time.monotonic()
        return sent

    def _read(self) -> None:
        while not self._ended:
            try:
                data = self._socket.recv(_PIECE)
            except _BUSY:
                return
            except (OSError, ValueError) as error:
                self.end(in_words(error))
                return
            if not data:
                self.end("the broker has closed the connection")
                return
            self.heard_at = time.monotonic()
            self._on_data(data)
            # TLS may hold packets that it has already read from the socket: the socket does not wake us for those.
            if not pending(self._socket):
                return


async def reach(address: BrokerAddress, timeout: float) -> Socket:
    """Name look-up, TCP and TLS, in a thread: they block, and the loop must keep metering.

    Not in the loop's thread pool: the daemon would have to wait for it when it stops. Raises OSError,
    ValueError and UserError.
    """
    loop = asyncio.get_running_loop()
    reached: asyncio.Future[Socket] = loop.create_future()

    def tell(result: Socket | Exception) -> None:
        if isinstance(result, Exception):
            if not reached.cancelled():
                reached.set_exception(result)
        elif reached.cancelled():
            result.close()
        else:
            reached.set_result(result)

    def connect() -> None:
        try:
            result: Socket | Exception = dial(address, timeout)
        except (OSError, ValueError, UserError) as error:
            result = error
        with contextlib.suppress(RuntimeError):  # the loop has closed meanwhile
            loop.call_soon_threadsafe(tell, result)

    threading.Thread(target=connect, name="mqtt-connect", daemon=True).start()
    return await reached


def in_words(error: Exception) -> str:
    """Why a connection failed."""
    return getattr(error, "strerror", None) or str(error)
