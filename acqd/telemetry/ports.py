"""TCP ports of this computer."""

from __future__ import annotations

import errno
import socket

from acqd.errors import UserError


def bare_host(host: str) -> str:
    """The name or address of a computer, as it is. Raises ValueError where it is empty, or has a scheme or a port.

    An IPv6 address has more than one colon.
    """
    if len(host.split()) != 1 or host != host.strip():
        raise ValueError("expected a name or an address without blanks, such as 127.0.0.1")
    name, colon, port = host.partition(":")
    if "/" in host or (colon and (not port or port.isdecimal())):
        rest = host.partition("://")[2] if "://" in host else host
        bare = rest.partition("/")[0].partition("@")[2] or rest.partition("/")[0]
        raise ValueError(
            f"expected a name or an address alone, such as {bare.partition(':')[0] or name}; port has its own place"
        )
    return host


def check_port(host: str, port: int, of: str = "broker", setting: str = "") -> None:
    """Raise UserError unless this process may listen on host:port; `of` wants to, and `setting` chooses its port."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            if isinstance(error, socket.gaierror) or error.errno == errno.EADDRNOTAVAIL:
                raise UserError(
                    f"{of} {host}: this computer has no such address; expected 127.0.0.1, 0.0.0.0 or one of its own"
                ) from None
            if error.errno == errno.EACCES:
                raise UserError(
                    f"{of} port {host}:{port}: this user may not listen below 1024; choose another port"
                    f"{setting and f' with {setting}'}"
                ) from None
            raise UserError(
                f"{of} port {host}:{port} cannot be used ({error.strerror}): is another {of} running there? "
                f"Use that one, or choose another port{setting and f' with {setting}'}"
            ) from None


def free_port(host: str = "127.0.0.1") -> int:
    """A port nobody listens on right now."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])
