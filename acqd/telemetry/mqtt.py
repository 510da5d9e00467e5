"""How to reach a broker, shared by everything here that speaks MQTT."""

from __future__ import annotations

import contextlib
import ipaddress
import socket
import ssl
from dataclasses import dataclass, field
from pathlib import Path

from acqd.errors import UserError, without_number


@dataclass(frozen=True, slots=True)
class BrokerAddress:
    """Where the broker is and how it wants to be spoken to."""

    host: str = "127.0.0.1"
    port: int = 1883
    username: str | None = None
    password: str | None = field(default=None, repr=False)
    tls: bool = False
    ca_file: Path | None = None
    """CA to trust instead of the system's."""
    cert_file: Path | None = None
    """Client certificate, with `key_file`."""
    key_file: Path | None = None

    def __str__(self) -> str:
        return f"{'mqtts' if self.tls else 'mqtt'}://{self.host}:{self.port}"

    def tls_context(self) -> ssl.SSLContext | None:
        """The TLS settings, None without TLS. Raises UserError for unusable files."""
        if not self.tls:
            return None
        try:
            for name in ("ca_file", "cert_file", "key_file"):
                path = getattr(self, name)
                if path is not None and not path.exists():
                    raise UserError(f"TLS for {self}: {name} {path}: no such file; check its path")
            wrong = f"ca_file {self.ca_file}: holds no certificate in PEM"
            context = ssl.create_default_context(cafile=str(self.ca_file) if self.ca_file else None)
            context.minimum_version = ssl.TLSVersion.TLSv1_2  # RFC 8996
            if self.cert_file:
                wrong = f"cert_file {self.cert_file} and key_file {self.key_file}: no certificate with its key in PEM"
                context.load_cert_chain(self.cert_file, self.key_file, password="")  # asks nobody for a passphrase
        except ssl.SSLError:
            raise UserError(f"TLS for {self}: {wrong}; config/make-certificates.sh makes such files") from None
        except OSError as error:
            raise UserError(f"TLS for {self}: {error}; check ca_file, cert_file and key_file") from None
        return context

    @property
    def exposes_password(self) -> bool:
        """Whether the password goes over a network in clear text."""
        return self.password is not None and not self.tls and not is_loopback(self.host)


def is_loopback(host: str) -> bool:
    """Whether a host is this computer: by its address, for 127.0.0.1.example.org is somebody's name."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


NO_DELAY = [(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)]
"""Socket options: without this a row waits for the acknowledgement of the one before (Nagle)."""


def dial(address: BrokerAddress, timeout: float) -> socket.socket | ssl.SSLSocket:
    """A connection by TCP and, where wanted, TLS, which does not block any more.

    Certificates are read for each connection: they end, and are replaced while services run. Raises OSError,
    ValueError, and UserError for files that cannot be used.
    """
    plain = socket.create_connection((address.host, address.port), timeout)
    try:
        with contextlib.suppress(OSError):
            for option in NO_DELAY:
                plain.setsockopt(*option)
        tls = address.tls_context()
        sock = tls.wrap_socket(plain, server_hostname=address.host) if tls is not None else plain
        sock.setblocking(False)
    except BaseException:
        plain.close()
        raise
    return sock


def pending(sock: object) -> bool:
    """Whether a TLS socket holds received bytes that select() does not report."""
    return isinstance(sock, ssl.SSLSocket) and sock.pending() > 0


def refusal(address: BrokerAddress, reason: str) -> UserError:
    """The error for a broker that answered and refused us."""
    who = f" of {address.username}" if address.username else ""
    said = f"refused the connection{who}: {without_number(reason)}"
    return UserError(f"broker {address} {said}; check username, password and TLS")


REFUSED = {"not authorized", "bad user name or password", "bad username or password", "banned", "not authorised"}


def is_refusal(reason: str) -> bool:
    """Whether a connection error is the broker's final word rather than a passing fault."""
    return any(word in reason.lower() for word in REFUSED)
