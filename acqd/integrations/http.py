"""One POST to an address of the configuration; redirects are not followed."""

from __future__ import annotations

import ssl
from http.client import HTTPConnection, HTTPException, HTTPSConnection
from typing import NamedTuple
from urllib.parse import urlsplit

_TIMEOUT_S = 10.0
_MOST = 10_000
"""Bytes of an answer that are read."""


class Answer(NamedTuple):
    """What the server said."""

    code: int
    reason: str
    body: bytes

    @property
    def good(self) -> bool:
        """Whether it has taken the content."""
        return 200 <= self.code < 300


def post(url: str, body: bytes, headers: dict[str, str]) -> Answer:
    """POST `body`. Raises OSError when nothing that speaks HTTP answers."""
    parts = urlsplit(url)
    host, port = parts.hostname or "", parts.port
    connection = (
        HTTPSConnection(host, port, timeout=_TIMEOUT_S, context=ssl.create_default_context())
        if parts.scheme == "https"
        else HTTPConnection(host, port, timeout=_TIMEOUT_S)
    )
    try:
        connection.request("POST", f"{parts.path or '/'}{f'?{parts.query}' if parts.query else ''}", body, headers)
        answer = connection.getresponse()
        return Answer(answer.status, answer.reason, answer.read(_MOST))
    except (HTTPException, UnicodeError) as error:
        raise OSError(f"no answer in HTTP ({type(error).__name__})") from None
    finally:
        connection.close()
