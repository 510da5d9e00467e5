"""A TCP proxy that misbehaves on demand: latency, resets, refused connections, half-open ones."""

from __future__ import annotations

import socket
import struct
import threading
import time
from contextlib import suppress
from typing import Literal

from acqd.telemetry.ports import free_port

Mode = Literal["pass", "silent", "refuse"]
_CHUNK = 65_536
_LINGER_0 = struct.pack("ii", 1, 0)
"""SO_LINGER with 0 s: close sends RST."""


class Proxy:
    """Forwards connections to `target`, a port on this computer, through threads."""

    def __init__(self, target: int) -> None:
        self.port = free_port()
        self._target = target
        self.mode: Mode = "pass"
        """`silent`: nothing passes and nothing is closed (half-open); `refuse`: new connections are reset."""
        self.latency_s = 0.0
        """One way [s]."""
        self._pairs: set[tuple[socket.socket, socket.socket]] = set()
        self._server = socket.create_server(("127.0.0.1", self.port))
        threading.Thread(target=self._accept, daemon=True).start()

    def reset(self) -> None:
        """Reset every connection."""
        for pair in list(self._pairs):
            self._break(pair)

    def close(self) -> None:
        """Stop listening and reset every connection."""
        with suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self.reset()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._server.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        while self.mode == "silent":  # the connection is there, nobody answers
            time.sleep(0.02)
        try:
            if self.mode == "refuse":
                raise OSError
            server = socket.create_connection(("127.0.0.1", self._target), timeout=5)
            server.settimeout(None)
        except OSError:
            _reset(client)
            return
        pair = client, server
        for sock in pair:
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._pairs.add(pair)
        for source, sink in (pair, pair[::-1]):
            threading.Thread(target=self._pump, args=(source, sink, pair), daemon=True).start()

    def _pump(self, source: socket.socket, sink: socket.socket, pair: tuple[socket.socket, socket.socket]) -> None:
        """Copy one direction until an end closes. Delayed data keep their order, and their distances."""
        try:
            while data := source.recv(_CHUNK):
                due = time.monotonic() + self.latency_s
                while self.mode == "silent" or time.monotonic() < due:
                    time.sleep(0.005)
                    if pair not in self._pairs:
                        return
                sink.sendall(data)
        except OSError:
            pass
        finally:
            self._break(pair)

    def _break(self, pair: tuple[socket.socket, socket.socket]) -> None:
        self._pairs.discard(pair)
        for sock in pair:
            _reset(sock)


def _reset(sock: socket.socket) -> None:
    with suppress(OSError):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER_0)
        sock.shutdown(socket.SHUT_RD)  # wakes the thread that reads, and sends nothing
    with suppress(OSError):
        sock.close()
