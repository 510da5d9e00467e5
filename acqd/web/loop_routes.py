"""Requests of the page that start, cancel and apply the loop.

They change something, so a token or cookie alone is not enough: only a request of this page's own script passes. It
has a header that other sites cannot set without a permission that is never given (CORS), and its origin is this host.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import orjson
import sqlalchemy as sa
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from acqd.errors import UserError
from acqd.web.answers import as_response
from acqd.web.applying import LOG, applied, apply
from acqd.web.job import LoopJob
from acqd.web.predictions import alarms
from acqd.web.proxy import acts, named
from acqd.web.reports import summary
from acqd.web.settings import WebSettings

HEADER = "x-acqd"
_LARGEST = 4096


class LoopRoutes:
    """The loop over HTTP; without `[web] loop = true` every request but the state is refused."""

    def __init__(self, settings: WebSettings, engine: Any) -> None:
        """`engine`: function that opens the database. It raises UserError."""
        self._settings, self._section, self._engine = settings, settings.section, engine
        self.job = LoopJob(settings)
        self.others: Callable[[], bool] = lambda: False
        """Whether other work takes the cores that a search needs."""

    def routes(self) -> list[Route]:
        """GET the state; POST start, cancel, apply."""
        changes = {"start": self._start, "cancel": self._cancel, "apply": self._apply}
        posts = [Route(f"/api/loop/{name}", self._guarded(work), methods=["POST"]) for name, work in changes.items()]
        return [Route("/api/loop", self._state), *posts]

    async def _state(self, request: Request) -> Response:
        return as_response(await asyncio.to_thread(self._shown) if acts(request) else {"enabled": False})

    def _shown(self) -> dict[str, Any]:
        if not self._section.loop:
            return {"enabled": False}
        assert self._section.reports is not None
        shown: dict[str, Any] = {"enabled": True, "job": self.job.as_json(), "model": str(self._section.model)}
        shown["applied"] = applied(self._section.reports / LOG)
        try:
            shown["alarms"] = alarms(self._engine())[:5]
        except (UserError, sa.exc.SQLAlchemyError):
            shown["alarms"] = []
        if self.job.state.state == "done":
            shown["proposal"] = summary(self._section.reports / self.job.state.folder / "result")
        return shown

    def _guarded(self, work: Any) -> Any:
        async def guarded(request: Request) -> Response:
            if not self._section.loop:
                return as_response({"error": "the loop is off: set loop = true in [web]"}, 403)
            if not own_request(request):
                return as_response({"error": "this request does not come from the page"}, 403)
            try:
                body = orjson.loads((await request.body())[:_LARGEST] or b"{}")
                await work(body if isinstance(body, dict) else {}, request)
            except (UserError, orjson.JSONDecodeError) as error:
                return as_response({"error": str(error)}, 409)
            except (KeyError, TypeError, ValueError):
                return as_response({"error": "the request is incomplete; load the page again"}, 400)
            except sa.exc.SQLAlchemyError:
                return as_response({"error": "the database is busy; try again"}, 503)
            return as_response(await asyncio.to_thread(self._shown))

        return guarded

    async def _start(self, body: dict[str, Any], _: Request) -> None:
        if self.others():
            raise UserError("files are being worked through: wait, or cancel that")
        device, since_s = str(body.get("device", "")), float(body["since"])
        await asyncio.to_thread(lambda: self.job.start(self._engine(), device, since_s))
        self.job.run()

    async def _cancel(self, _body: dict[str, Any], _: Request) -> None:
        await self.job.cancel()

    async def _apply(self, body: dict[str, Any], request: Request) -> None:
        """Of the job that the page has shown: another one may have ended meanwhile."""
        state = self.job.state
        if state.state != "done" or body["folder"] != state.folder:
            raise UserError("this proposal is not the newest; look at the newest one first")
        assert self._section.reports is not None and self._section.model is not None
        reports, address = self._section.reports, named(request)
        proposal, name = reports / state.folder / "result" / "model", str(body["name"])
        await asyncio.to_thread(apply, proposal, self._section.model, reports / LOG, name, address)


def own_request(request: Request) -> bool:
    """Whether a request comes from the page's own script."""
    origin, host = request.headers.get("origin", ""), request.headers.get("host", "")
    site = request.headers.get("sec-fetch-site", "same-origin")
    same = origin.partition("://")[2] == host
    return same and site == "same-origin" and request.headers.get(HEADER) == "page"
