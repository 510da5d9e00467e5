"""Serves the live page until it is asked to stop."""

from __future__ import annotations

from types import FrameType

import uvicorn

from acqd.web.app import Site
from acqd.web.limited import LimitedProtocol
from acqd.web.settings import WebSettings


class Server(uvicorn.Server):
    """uvicorn, which ends the streams of all viewers before it waits for them."""

    def __init__(self, settings: WebSettings) -> None:
        self._site = Site(settings)
        # no access log: the address may hold the token
        super().__init__(
            uvicorn.Config(
                self._site.app(), host=settings.host, port=settings.port, log_level="warning", access_log=False,
                timeout_graceful_shutdown=5, http=LimitedProtocol,
            )
        )  # fmt: skip

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:  # noqa: ARG002 - as uvicorn calls it
        """Of SIGINT and SIGTERM; uvicorn's own would raise the signal again once everything has ended well."""
        self.force_exit = self.should_exit  # asked twice
        self.end()

    def end(self) -> None:
        """Stop soon; from any thread."""
        self._site.hub.end()
        self.should_exit = True
