"""When certificates end (X.509, RFC 5280, section 4.1): of PEM files, without a library for one date."""

from __future__ import annotations

import re
import socket
import ssl
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

_WARN = timedelta(days=30)
"""A certificate that ends sooner is a problem: somebody has to make another one and bring it to the plant."""
_SHARE = 4
"""Those of a shorter life are renewed by programs when a third of it is left (ACME clients), so that none of them is
near its end before a quarter is."""
_PEM = re.compile(rb"-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----", re.DOTALL)
_VERSION, _UTC_TIME, _GENERALIZED_TIME = 0xA0, 0x17, 0x18


@dataclass(frozen=True, slots=True, order=True)
class Validity:
    """When a certificate is valid (UTC)."""

    ends: datetime
    begins: datetime


def of_file(path: Path) -> Validity | None:
    """That of the certificate in a PEM file that ends first; None: it has none. Raises OSError; ValueError: damage."""
    found = [validity(ssl.PEM_cert_to_DER_cert(pem.decode("ascii"))) for pem in _PEM.findall(path.read_bytes())]
    return min(found, default=None)


def validity(der: bytes) -> Validity:
    """When a certificate is valid. Raises ValueError."""
    try:
        certificate = next(_parts(der))[1]
        fields = [part for part in _parts(next(_parts(certificate))[1]) if part[0] != _VERSION]
        begin, end = _parts(fields[3][1])  # after serial number, signature and issuer
    except (IndexError, StopIteration, ValueError):
        raise ValueError("is no certificate") from None
    return Validity(_time(end), _time(begin))


def _time(part: tuple[int, bytes]) -> datetime:
    form = {_UTC_TIME: "%y%m%d%H%M%SZ", _GENERALIZED_TIME: "%Y%m%d%H%M%SZ"}.get(part[0])
    if form is None:
        raise ValueError("a certificate without begin and end")
    return datetime.strptime(part[1].decode("ascii", "replace"), form).replace(tzinfo=UTC)


def trouble(paths: Iterable[Path | None], now: float | None = None) -> str:
    """Which certificate ends soon, or cannot be read; else empty. `now`: Unix s."""
    for path in paths:
        if path is None:
            continue
        try:
            valid = of_file(path)
        except (OSError, ValueError) as error:
            return f"certificate {path}: {getattr(error, 'strerror', None) or error}"
        if near := near_end(str(path), valid, now):
            return near
    return ""


def near_end(name: str, valid: Validity | None, now: float | None = None) -> str:
    """That a certificate ends soon or has ended, else empty. `now`: Unix s."""
    if valid is None:
        return ""
    left = valid.ends - datetime.fromtimestamp(time.time() if now is None else now, UTC)
    if left >= min(_WARN, (valid.ends - valid.begins) / _SHARE):
        return ""
    days = left / timedelta(days=1)
    when = f"ends in {days:.0f} days, on {valid.ends:%Y-%m-%d}" if days > 0 else f"has ended on {valid.ends:%Y-%m-%d}"
    return f"certificate {name} {when}"


def of_peer(sock: socket.socket) -> Validity | None:
    """That of the certificate that the other side of a connection has shown; None without TLS."""
    shown = sock.getpeercert(binary_form=True) if isinstance(sock, ssl.SSLSocket) else None
    try:
        return None if shown is None else validity(shown)
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
