"""The ASGI application of the live page."""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import mimetypes
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import asdict
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, Response, StreamingResponse
from starlette.routing import Route

from acqd.daemon.health.query import SERVICES, Answer, ask
from acqd.daemon.health.runbook import entry_for
from acqd.errors import UserError
from acqd.report.arm_view import ASSETS as OF_REPORTS
from acqd.report.arm_view import ON_DEMAND
from acqd.storage.database import read_database
from acqd.web.access import Access
from acqd.web.answers import HEADERS, NOT_KEPT, as_response
from acqd.web.archived import second
from acqd.web.energy import EnergyOfDays
from acqd.web.export import lines
from acqd.web.files_routes import FilesRoutes
from acqd.web.history import Span, devices, history
from acqd.web.hub import Hub
from acqd.web.loop_routes import LoopRoutes
from acqd.web.posture import Posture
from acqd.web.predictions import course, logs
from acqd.web.proxy import BehindProxy, acts
from acqd.web.reports import REPORT_POLICY, newest_report, summary
from acqd.web.runbook import runbook_page
from acqd.web.scope import Scope, ScopeError
from acqd.web.settings import WebSettings

_ASSETS = Path(__file__).with_name("assets")
_SUFFIXES = {".css", ".js", ".LICENSE"}
_NO_DATABASE = "the database is not there yet: does a sink write to it?"


class Site:
    """The page with its data."""

    def __init__(self, settings: WebSettings) -> None:
        self._settings = settings
        self._posture = Posture(settings.section.robot)
        self.hub = Hub(settings.broker, self._posture)
        self._scope = Scope(settings.health)
        self._loop = LoopRoutes(settings, self._database)
        self._files = FilesRoutes(settings, self._loop.job)
        self._loop.others = lambda: self._files.files.running
        self._days = EnergyOfDays(settings.energy)
        self._engine: sa.Engine | None = None
        self._assets = {path.name: path for path in _ASSETS.iterdir() if path.suffix in _SUFFIXES}
        self._assets |= {name: OF_REPORTS / name for name in ON_DEMAND}

    def app(self) -> Starlette:
        """To be served."""
        gets = {
            "/": self._page, "/events": self._events, "/assets/{name}": self._asset, "/runbook": self._runbook,
            "/report": self._report, "/api/history": self._history, "/api/devices": self._devices,
            "/api/health": self._health, "/api/window": self._window, "/api/predictions": self._predictions,
            "/api/course": self._course, "/api/report": self._newest, "/api/energy": self._energy,
            "/api/arm": self._arm, "/api/export": self._export,
        }  # fmt: skip
        routes = [*(Route(path, endpoint) for path, endpoint in gets.items()), *self._loop.routes()]
        routes += self._files.routes()
        return Starlette(routes=routes, middleware=[self._door()], lifespan=self._lifespan)

    def _door(self) -> Middleware:
        proxy = self._settings.section.proxy
        if proxy is not None:
            return Middleware(BehindProxy, secret=self._settings.proxy_secret, section=proxy)
        hosts = frozenset({self._settings.host, "127.0.0.1", "localhost", "[::1]"})
        return Middleware(Access, token=self._settings.token, hosts=hosts)

    @contextlib.asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        task = asyncio.create_task(self.hub.run())
        yield
        task.cancel()
        await self._loop.job.cancel()
        await self._files.files.cancel()

    async def _page(self, request: Request) -> Response:
        return await _file(_ASSETS / "index.html", request, HEADERS)

    async def _asset(self, request: Request) -> Response:
        name = request.path_params["name"]
        if name not in self._assets:
            return Response("no such file", 404)
        return await _file(self._assets[name], request, HEADERS | {"cache-control": "no-cache"})

    async def _events(self, _: Request) -> Response:
        headers = NOT_KEPT | {"x-accel-buffering": "no"}
        return StreamingResponse(self.hub.events(), media_type="text/event-stream", headers=headers)

    async def _runbook(self, _: Request) -> Response:
        return HTMLResponse(runbook_page(), headers=HEADERS)

    async def _report(self, _: Request) -> Response:
        newest = await asyncio.to_thread(newest_report, self._settings.section.reports)
        if newest is None:
            return Response("there is no report yet", 404, HEADERS)
        policy = {"content-security-policy": REPORT_POLICY}
        return FileResponse(newest / "report.html", headers=NOT_KEPT | policy)

    async def _newest(self, _: Request) -> Response:
        newest = await asyncio.to_thread(newest_report, self._settings.section.reports)
        return as_response(await asyncio.to_thread(summary, newest) if newest is not None else {})

    async def _devices(self, _: Request) -> Response:
        return await self._answer(lambda engine: {"devices": devices(engine)})

    async def _history(self, request: Request) -> Response:
        try:
            span = _span(request)
        except ValueError as error:
            return as_response({"error": str(error)}, 400)
        return await self._answer(lambda engine: history(engine, span))

    async def _energy(self, request: Request) -> Response:
        return await self._answer(lambda engine: self._days.of(engine, request.query_params.get("device", "")))

    async def _export(self, request: Request) -> Response:
        try:
            span = _span(request)
            engine = await asyncio.to_thread(self._database)
        except ValueError as error:
            return as_response({"error": str(error)}, 400)
        except UserError:
            return as_response({"error": _NO_DATABASE}, 503)
        end = span.end or time.time()
        begin = datetime.fromtimestamp(end - span.seconds, UTC)
        name = "".join(c for c in span.device if c.isalnum() or c in "-_.") or "acqd"
        attached = {"content-disposition": f'attachment; filename="{name}-{begin:%Y%m%dT%H%M%SZ}.csv"'}
        return StreamingResponse(lines(engine, span, end), headers=NOT_KEPT | attached, media_type="text/csv")

    async def _predictions(self, _: Request) -> Response:
        return await self._answer(lambda engine: {"logs": logs(engine), "note": self._posture.note})

    async def _arm(self, _: Request) -> Response:
        return as_response(self._posture.as_json())

    async def _course(self, request: Request) -> Response:
        return await self._answer(lambda engine: course(engine, request.query_params.get("sha256", "")))

    async def _window(self, request: Request) -> Response:
        device, at = request.query_params.get("device", ""), request.query_params.get("at")
        try:
            if at is not None:
                return as_response(await asyncio.to_thread(second, self._settings.archive, device, float(at)))
            return as_response(await asyncio.to_thread(self._scope.picture, device))
        except (ValueError, OverflowError):
            return as_response({"error": f"at {at!r:.40}: expected Unix seconds"}, 400)
        except ScopeError as error:
            return as_response({"note": str(error)})  # a state to show, not a failure of the page

    async def _answer(self, query: Callable[[sa.Engine], Any]) -> Response:
        try:
            return as_response(await asyncio.to_thread(lambda: query(self._database())))
        except (UserError, sa.exc.SQLAlchemyError) as error:
            text = _NO_DATABASE if isinstance(error, UserError) else "the database is busy"
            return as_response({"error": text}, 503)

    def _database(self) -> sa.Engine:
        """Opened with the first question. Raises UserError."""
        if self._engine is None:
            self._engine = read_database(self._settings.database)
        return self._engine

    async def _health(self, request: Request) -> Response:
        section = self._settings.health
        answers = await asyncio.gather(*(asyncio.to_thread(ask, section, service) for service in SERVICES))
        links = {text: entry.anchor for each in answers if each for text in _said(each) if (entry := entry_for(text))}
        page = {
            "viewers": self.hub.viewers, "lost": self.hub.lost, "connected": self.hub.connected,
            "files": self._settings.section.files and acts(request),
        }  # fmt: skip
        return as_response(
            {"services": [asdict(each) for each in answers if each is not None], "page": page, "runbook": links}
        )


def _span(request: Request) -> Span:
    """What a request asks for. Raises ValueError."""
    query = request.query_params
    end = query.get("end")
    seconds = float(query.get("seconds", "60"))
    return Span(query.get("device", ""), seconds, query.get("quantity", "P"), None if end is None else float(end))


def _said(answer: Answer) -> list[str]:
    return [*answer.problems, *answer.notes]


async def _file(path: Path, request: Request, headers: dict[str, str]) -> Response:
    """A file of the page, compressed for browsers that take it."""
    if "gzip" not in request.headers.get("accept-encoding", ""):
        return FileResponse(path, headers=headers)
    packed = await asyncio.to_thread(_packed, path, path.stat().st_mtime_ns)
    headers = headers | {"content-encoding": "gzip", "vary": "accept-encoding"}
    return Response(packed, headers=headers, media_type=mimetypes.guess_type(path.name)[0])


@lru_cache
def _packed(path: Path, _changed_ns: int) -> bytes:
    """The file as gzip, made once."""
    return gzip.compress(path.read_bytes(), mtime=0)
