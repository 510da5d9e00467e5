"""A server that is reached through another port only while a test wants it."""

from __future__ import annotations

import socket
import threading
from contextlib import contextmanager


@contextmanager
def forwarded(port, to):
    """The server at `to` is reached at `port` as well."""
    listener = socket.create_server(("127.0.0.1", port))

    def pump(source, target):
        while data := source.recv(1 << 16):
            target.sendall(data)
        target.shutdown(socket.SHUT_WR)

    def accept():
        while True:
            try:
                near = listener.accept()[0]
            except OSError:
                return
            far = socket.create_connection(("127.0.0.1", to))
            for pair in ((near, far), (far, near)):
                threading.Thread(target=pump, args=pair, daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    yield
    listener.close()
