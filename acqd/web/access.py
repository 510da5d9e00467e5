"""Who may look: a token in the address, which becomes a cookie, and only this page's own host name."""

from __future__ import annotations

import hmac
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_COOKIE = "acqd"


class Access:
    """Refuses whoever does not know the token, and other sites that point their name at this computer."""

    def __init__(self, app: ASGIApp, *, token: str | None, hosts: frozenset[str]) -> None:
        """`hosts`: names under which the page may be asked for, without a token (DNS rebinding)."""
        self._app, self._token, self._hosts = app, token, hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or answer it with 403."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if self._token is None:
            allowed, cookie = _name_of(headers.get("host", "")) in self._hosts, None
        else:
            query = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
            by_query = hmac.compare_digest(query.encode(), self._token.encode())
            by_cookie = hmac.compare_digest(_cookie(headers.get("cookie", "")).encode(), self._token.encode())
            allowed, cookie = by_query or by_cookie, self._token if by_query else None
        if not allowed:
            text = "acqd: the address needs ?token=..., which acqd web printed when it started\n"
            await PlainTextResponse(text, 403)(scope, receive, send)
            return
        await self._app(scope, receive, _with_cookie(send, cookie) if cookie else send)


def _name_of(host: str) -> str:
    return host.rpartition(":")[0] if host.rpartition(":")[2].isdigit() and ":" in host else host


def _cookie(header: str) -> str:
    try:
        found = SimpleCookie(header).get(_COOKIE)
    except CookieError:
        return ""
    return found.value if found else ""


def _with_cookie(send: Send, token: str) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            value = f"{_COOKIE}={token}; Path=/; HttpOnly; SameSite=Strict".encode()
            message["headers"] = [*message["headers"], (b"set-cookie", value)]
        await send(message)

    return sending
