"""When certificates end (X.509, RFC 5280, section 4.1): of PEM files, without a library for one date."""

from __future__ import annotations

import re
import socket
import ssl
import time
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path

WARN_DAYS = 30.0
"""A certificate that ends sooner is a problem: somebody has to make another one and bring it to the plant."""
_PEM = re.compile(rb"-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----", re.DOTALL)
_VERSION, _UTC_TIME, _GENERALIZED_TIME = 0xA0, 0x17, 0x18


def ends(path: Path) -> datetime | None:
    """The earliest end of the certificates in a PEM file; None: it has none. Raises OSError; ValueError for damage."""
    found = [not_after(ssl.PEM_cert_to_DER_cert(pem.decode("ascii"))) for pem in _PEM.findall(path.read_bytes())]
    return min(found, default=None)


def not_after(der: bytes) -> datetime:
    """The end of a certificate's validity. Raises ValueError."""
    try:
        certificate = next(_parts(der))[1]
        fields = [part for part in _parts(next(_parts(certificate))[1]) if part[0] != _VERSION]
        _, end = _parts(fields[3][1])  # after serial number, signature and issuer: begin and end
    except (IndexError, StopIteration, ValueError):
        raise ValueError("is no certificate") from None
    form = {_UTC_TIME: "%y%m%d%H%M%SZ", _GENERALIZED_TIME: "%Y%m%d%H%M%SZ"}.get(end[0])
    if form is None:
        raise ValueError("a certificate without an end")
    return datetime.strptime(end[1].decode("ascii", "replace"), form).replace(tzinfo=UTC)


def trouble(paths: Iterable[Path | None], now: float | None = None) -> str:
    """Which certificate ends within `WARN_DAYS`, or cannot be read; else empty. `now`: Unix s."""
    for path in paths:
        if path is None:
            continue
        try:
            end = ends(path)
        except (OSError, ValueError) as error:
            return f"certificate {path}: {getattr(error, 'strerror', None) or error}"
        if near := near_end(str(path), end, now):
            return near
    return ""


def near_end(name: str, end: datetime | None, now: float | None = None) -> str:
    """That a certificate ends within `WARN_DAYS` or has ended, else empty. `now`: Unix s."""
    if end is None:
        return ""
    days = (end.timestamp() - (time.time() if now is None else now)) / 86_400
    if days >= WARN_DAYS:
        return ""
    when = f"ends in {days:.0f} days, on {end:%Y-%m-%d}" if days > 0 else f"has ended on {end:%Y-%m-%d}"
    return f"certificate {name} {when}"


def end_of_peer(sock: socket.socket) -> datetime | None:
    """The end of the certificate that the other side of a connection has shown; None without TLS."""
    shown = sock.getpeercert(binary_form=True) if isinstance(sock, ssl.SSLSocket) else None
    try:
        return None if shown is None else not_after(shown)
    except ValueError:
        return None


def _parts(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Tag and content of the elements of a DER value (ITU-T X.690, section 8.1). Raises IndexError, ValueError."""
    at = 0
    while at < len(data):
        tag, length = data[at], data[at + 1]
        at += 2
        if length & 0x80:
            size = length & 0x7F
            length = int.from_bytes(data[at : at + size], "big")
            at += size
        if at + length > len(data):
            raise ValueError("cut off")
        yield tag, data[at : at + length]
        at += length
