"""sd_notify: tells systemd that we are ready, alive and stopping."""

from __future__ import annotations

import os
import socket


def notify(state: str) -> None:
    """Send `state` (READY=1, WATCHDOG=1, STOPPING=1, STATUS=...) if systemd listens."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    if address.startswith("@"):
        address = "\0" + address[1:]
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sock:
        try:
            sock.sendto(state.encode(), address)
        except OSError:
            return  # systemd is restarting; the next message reaches it
