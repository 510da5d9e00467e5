"""The ASGI application of the live page."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import orjson
import sqlalchemy as sa
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, Response, StreamingResponse
from starlette.routing import Route

from acqd.daemon.health.query import SERVICES, Answer, ask
from acqd.daemon.health.runbook import entry_for
from acqd.errors import UserError
from acqd.storage.database import read_database
from acqd.web.access import Access
from acqd.web.history import Span, devices, history
from acqd.web.hub import Hub
from acqd.web.runbook import runbook_page
from acqd.web.settings import WebSettings

_ASSETS = Path(__file__).with_name("assets")
_PUBLIC = ("page.css", "page.js", "uPlot.min.css", "uPlot.iife.min.js", "uPlot.LICENSE")
_POLICY = "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'"
_HEADERS = {
    "content-security-policy": _POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
}
_NO_DATABASE = "the database is not there yet: does a sink write to it?"


class Site:
    """The page with its data."""

    def __init__(self, settings: WebSettings) -> None:
        self._settings = settings
        self.hub = Hub(settings.broker)
        self._engine: sa.Engine | None = None

    def app(self) -> Starlette:
        """To be served."""
        routes = [
            Route("/", self._page), Route("/events", self._events), Route("/api/history", self._history),
            Route("/api/devices", self._devices), Route("/api/health", self._health),
            Route("/assets/{name}", self._asset), Route("/runbook", self._runbook),
        ]  # fmt: skip
        hosts = frozenset({self._settings.host, "127.0.0.1", "localhost", "[::1]"})
        guard = Middleware(Access, token=self._settings.token, hosts=hosts)
        return Starlette(routes=routes, middleware=[guard], lifespan=self._lifespan)

    @contextlib.asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        task = asyncio.create_task(self.hub.run())
        yield
        task.cancel()

    async def _page(self, _: Request) -> Response:
        return FileResponse(_ASSETS / "index.html", headers=_HEADERS)

    async def _asset(self, request: Request) -> Response:
        name = request.path_params["name"]
        if name not in _PUBLIC:
            return Response("no such file", 404)
        return FileResponse(_ASSETS / name, headers=_HEADERS | {"cache-control": "no-cache"})

    async def _events(self, _: Request) -> Response:
        headers = _HEADERS | {"cache-control": "no-store", "x-accel-buffering": "no"}
        return StreamingResponse(self.hub.events(), media_type="text/event-stream", headers=headers)

    async def _devices(self, _: Request) -> Response:
        return await self._answer(lambda engine: {"devices": devices(engine)})

    async def _history(self, request: Request) -> Response:
        query = request.query_params
        try:
            span = Span(query.get("device", ""), float(query.get("seconds", "60")), query.get("quantity", "P"))
        except ValueError as error:
            return _json({"error": str(error)}, 400)
        return await self._answer(lambda engine: history(engine, span))

    async def _runbook(self, _: Request) -> Response:
        return HTMLResponse(runbook_page(), headers=_HEADERS)

    async def _answer(self, query: Any) -> Response:
        try:
            return _json(await asyncio.to_thread(lambda: query(self._database())))
        except (UserError, sa.exc.SQLAlchemyError) as error:
            return _json({"error": _NO_DATABASE if isinstance(error, UserError) else "the database is busy"}, 503)

    def _database(self) -> sa.Engine:
        """Opened with the first question. Raises UserError."""
        if self._engine is None:
            self._engine = read_database(self._settings.database)
        return self._engine

    async def _health(self, _: Request) -> Response:
        section = self._settings.health
        answers = await asyncio.gather(*(asyncio.to_thread(ask, section, service) for service in SERVICES))
        links = {text: entry.anchor for each in answers if each for text in _said(each) if (entry := entry_for(text))}
        page = {"viewers": self.hub.viewers, "lost": self.hub.lost, "connected": self.hub.connected}
        return _json(
            {"services": [asdict(each) for each in answers if each is not None], "page": page, "runbook": links}
        )


def _said(answer: Answer) -> list[str]:
    return [*answer.problems, *answer.notes]


def _json(content: object, status: int = 200) -> Response:
    return Response(orjson.dumps(content), status, _HEADERS | {"cache-control": "no-store"}, "application/json")
