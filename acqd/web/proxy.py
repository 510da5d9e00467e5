"""Who may look and who may act behind a reverse proxy that people log in to: the proxy names them in headers.

Headers are believed with the proxy's secret only. An address proves nothing: every user of this computer can connect to
a loopback port.
"""

from __future__ import annotations

import hmac
from dataclasses import dataclass

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from acqd.daemon.web_section import ProxySection
from acqd.errors import UserError

PROOF = "x-acqd-proxy"
_KEY = "acqd.person"
_MOST_LETTERS = 200


@dataclass(frozen=True, slots=True)
class Person:
    """Who has logged in."""

    name: str
    acts: bool
    """Whether the person may do more than look."""


class BehindProxy:
    """Lets pass what the proxy passes on for somebody with a role, and answers the rest with 403."""

    def __init__(self, app: ASGIApp, *, secret: str, section: ProxySection) -> None:
        """`secret`: what the proxy sends as X-Acqd-Proxy."""
        self._app, self._secret, self._section = app, secret.encode(), section

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        try:
            person = self._person(Headers(scope=scope))
            if scope["method"] not in ("GET", "HEAD") and not person.acts:
                raise UserError(f"{person.name} may look, and not act: no group is one of [web.proxy] act")
        except UserError as error:
            await PlainTextResponse(f"acqd: {error}\n", 403)(scope, receive, send)
            return
        await self._app({**scope, _KEY: person}, receive, send)

    def _person(self, headers: Headers) -> Person:
        """Raises UserError."""
        if not hmac.compare_digest(_only(headers, PROOF).encode(), self._secret):
            raise UserError("this page is behind a proxy: ask for it there")
        name = _only(headers, self._section.user_header)
        if not name or len(name) > _MOST_LETTERS or not name.isprintable():
            raise UserError("the proxy names nobody: is the login on?")
        groups = {group.strip() for group in _only(headers, self._section.groups_header).split(",")}
        acts = bool(groups & set(self._section.act))
        if not acts and not groups & set(self._section.read):
            raise UserError(f"{name} has no group that may look: see [web.proxy] read and act")
        return Person(name, acts)


def _only(headers: Headers, name: str) -> str:
    """The value of a header, in UTF-8 or else Latin-1; "" where it is missing, or there twice."""
    values = headers.getlist(name)
    if len(values) != 1:
        return ""
    try:
        return values[0].encode("latin-1").decode("utf-8")
    except UnicodeDecodeError:
        return values[0]


def acts(request: Request) -> bool:
    """Whether whoever asks may act: without a proxy, everybody who may look."""
    person = request.scope.get(_KEY)
    return person is None or bool(person.acts)


def named(request: Request) -> str:
    """Who asks, as the proxy says, and from where."""
    person, address = request.scope.get(_KEY), request.client.host if request.client else ""
    return f"{person.name} by the proxy at {address}" if person is not None else address
