"""Requests of the page that bring files, start and cancel; a file is the body of a request, written as it comes."""

from __future__ import annotations

from typing import Any

from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from acqd.errors import UserError
from acqd.web.answers import HEADERS, NOT_KEPT, as_response
from acqd.web.files import Files
from acqd.web.job import LoopJob
from acqd.web.loop_routes import own_request
from acqd.web.proxy import acts
from acqd.web.reports import OF_FILES, REPORT_POLICY
from acqd.web.settings import WebSettings

_PAGES = ("dataset", "result")
_BUSY = "a search is running: wait for it, or cancel it"


class FilesRoutes:
    """Files over HTTP; without `[web] files = true` every request but the state is refused."""

    def __init__(self, settings: WebSettings, loop: LoopJob) -> None:
        """`loop`: no files are worked through while it runs."""
        self._section, self._loop = settings.section, loop
        self.files = Files(settings)

    def routes(self) -> list[Route]:
        """GET the state and results; POST a file, start, cancel."""
        posts = {"add": self._add, "start": self._start, "cancel": self._cancel}
        return [
            Route("/api/files", self._state),
            Route("/files/{folder}/{page}/report.html", self._page),
            *(Route(f"/api/files/{name}", self._guarded(work), methods=["POST"]) for name, work in posts.items()),
        ]

    async def _state(self, request: Request) -> Response:
        return as_response(self._shown() if acts(request) else {"enabled": False})

    def _shown(self) -> dict[str, Any]:
        return {"enabled": True, **self.files.as_json()} if self._section.files else {"enabled": False}

    def _guarded(self, work: Any) -> Any:
        async def guarded(request: Request) -> Response:
            if not self._section.files:
                return as_response({"error": "files are off: set files = true in [web]"}, 403)
            if not own_request(request):
                return as_response({"error": "this request does not come from the page"}, 403)
            try:
                await work(request)
            except UserError as error:
                return as_response({"error": str(error)}, 409)
            return as_response(self._shown())

        return guarded

    async def _add(self, request: Request) -> None:
        try:
            await self.files.take(request.query_params.get("name", ""), request.stream(), _visit(request))
        except ClientDisconnect:
            raise UserError("the file was not sent completely") from None

    async def _start(self, request: Request) -> None:
        if self._loop.running:
            raise UserError(_BUSY)
        self.files.start(_visit(request))

    async def _cancel(self, request: Request) -> None:
        await self.files.cancel(_visit(request))

    async def _page(self, request: Request) -> Response:
        folder, page = request.path_params["folder"], request.path_params["page"]
        if self._section.files and self._section.reports and OF_FILES.fullmatch(folder) and page in _PAGES:
            path = self._section.reports / folder / page / "report.html"
            if path.is_file():
                return FileResponse(path, headers=NOT_KEPT | {"content-security-policy": REPORT_POLICY})
        return Response("there is no such report", 404, HEADERS)


def _visit(request: Request) -> str:
    return request.query_params.get("visit", "")
