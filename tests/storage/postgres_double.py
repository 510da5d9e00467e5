"""A PostgreSQL server that answers every connection with one error (protocol 3.0)."""

from __future__ import annotations

import socketserver
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def refusing(code: str, text: str, *, asks_password: bool) -> Iterator[int]:
    """Port of a server that says `text` with SQLSTATE `code`, before or after it has asked for a password."""

    class Handler(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            while (request := self._startup()) in (80877103, 80877104):  # TLS or GSS wanted
                self.request.sendall(b"N")
            if request and asks_password:
                self.request.sendall(b"R" + struct.pack("!II", 8, 3))  # in clear text
                self._rest(5)
            fields = b"".join(
                kind + value.encode() + b"\0" for kind, value in ((b"S", "FATAL"), (b"C", code), (b"M", text))
            )
            self.request.sendall(b"E" + struct.pack("!I", len(fields) + 5) + fields + b"\0")

        def _startup(self) -> int:
            body = self._rest(4)
            return struct.unpack("!I", body[:4])[0] if body else 0

        def _rest(self, head: int) -> bytes:
            """The rest of a packet whose length is in the last four bytes of its head."""
            begin = self.request.recv(head)
            return self.request.recv(struct.unpack("!I", begin[-4:])[0] - 4) if len(begin) == head else b""

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_address[1]
        server.shutdown()
