"""The endpoints /healthz, /readyz, /status, /metrics and /window, in a thread: a blocked service can still say so."""

from __future__ import annotations

import contextlib
import logging
import socket
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict
from http.server import BaseHTTPRequestHandler, HTTPServer
from socketserver import ThreadingMixIn
from typing import Any

import orjson

from acqd.daemon.health.runbook import links_for
from acqd.daemon.health.snapshot import Snapshot
from acqd.daemon.health.verdict import verdict
from acqd.telemetry.mqtt import is_loopback

Page = Callable[[str], tuple[int, str, bytes]]
"""Status code, content type and body of an endpoint, for a query string; called in a thread."""
_log = logging.getLogger(__name__)
_JSON = "application/json"
_REQUEST_S = 2.0  # for a client to say what it wants
_CLIENTS = 8  # at once: the oldest makes room for another one
_ROOM_S = 1.0  # for that to happen


class HealthServer:
    """Serves snapshots of one service; a port that cannot be used is logged and does not stop the service."""

    def __init__(
        self,
        host: str,
        port: int,
        snapshot: Callable[[], Snapshot],
        pages: Mapping[str, Page] | None = None,
        acknowledge: Callable[[], None] = lambda: None,
    ) -> None:
        """`pages`: further endpoints by their path; `acknowledge`: a person has seen the problems that were counted."""
        self._acknowledge = acknowledge
        self._host, self._port, self._snapshot, self._pages = host, port, snapshot, pages or {}
        self._server: _Server | None = None

    def start(self) -> None:
        """Listen."""
        try:
            handler = _handler(self._host, self._snapshot, self._pages, self._acknowledge)
            self._server = (_Server6 if ":" in self._host else _Server)((self._host, self._port), handler)
        except OSError as error:
            _log.info(
                "health: port %s:%d cannot be used (%s); this service has no endpoints, see [health]",
                self._host, self._port, error.strerror,
            )  # fmt: skip
            return
        threading.Thread(target=self._server.serve_forever, args=(0.2,), name="health", daemon=True).start()

    @property
    def port(self) -> int | None:
        """Where it listens; None: nowhere."""
        return self._server.server_address[1] if self._server is not None else None

    def stop(self) -> None:
        """Close the port."""
        if self._server is not None:
            self._server.shutdown()
            self._server.server_close()
            self._server = None


class _Server(ThreadingMixIn, HTTPServer):
    daemon_threads = True
    block_on_close = False
    request_queue_size = 16

    def __init__(self, *arguments: Any) -> None:
        self._free = threading.BoundedSemaphore(_CLIENTS)
        self._clients: dict[socket.socket, None] = {}  # in the order in which they came
        super().__init__(*arguments)

    def process_request(self, request: Any, client_address: Any) -> None:
        """A thread for this client; the oldest client, which may say its request letter by letter, makes room."""
        if not self._free.acquire(blocking=False):
            with contextlib.suppress(OSError, StopIteration, RuntimeError):  # it may be ending by itself
                next(iter(self._clients)).shutdown(socket.SHUT_RDWR)
            if not self._free.acquire(timeout=_ROOM_S):
                self.shutdown_request(request)
                return
        self._clients[request] = None
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            del self._clients[request]
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ARG002 - the base class's signature
        """A client that hangs up is no news."""
        _log.debug("health: request of %s failed", client_address, exc_info=True)


class _Server6(_Server):
    address_family = socket.AF_INET6


def _is_ours(name: str, host: str) -> bool:
    """Whether a request's Host names this computer: a stranger's page comes by a name of its own (DNS rebinding)."""
    bare = name.rsplit("]", 1)[0].lstrip("[") if name.startswith("[") else name.rsplit(":", 1)[0]
    return bare == host or is_loopback(bare)


def _handler(
    host: str, snapshot: Callable[[], Snapshot], pages: Mapping[str, Page], acknowledge: Callable[[], None]
) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        timeout = _REQUEST_S
        server_version, sys_version = "acqd", ""

        def do_GET(self) -> None:
            path, _, query = self.path.partition("?")
            if self._foreign():
                return
            self._answer(*(pages[path](query) if path in pages else _page(path, snapshot)))

        def do_POST(self) -> None:
            if self._foreign():
                return
            if self.path != "/acknowledge" or self.headers.get("Origin") is not None:  # no page may do this
                self.send_error(501)
                return
            acknowledge()
            self._answer(*_page("/status", snapshot))

        def _foreign(self) -> bool:
            if _is_ours(self.headers.get("Host", host), host):
                return False
            self._answer(421, _JSON, orjson.dumps({"error": "this host name is not of this computer"}))
            return True

        def _answer(self, code: int, kind: str, body: bytes) -> None:
            self.send_response(code)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: Any) -> None:
            """Requests are not logged: a probe comes every few seconds."""

    return Handler


def _page(path: str, snapshot: Callable[[], Snapshot]) -> tuple[int, str, bytes]:
    """Status code, content type and body of an endpoint."""
    if path not in ("/healthz", "/readyz", "/status", "/metrics"):
        return 404, _JSON, orjson.dumps({"error": "expected /healthz, /readyz, /status, /metrics or /window"})
    now = snapshot()
    if path == "/metrics":
        from acqd.daemon.health.metrics import CONTENT_TYPE, metrics  # 3 MB that few services are asked for

        return 200, CONTENT_TYPE, metrics(now)
    judged = verdict(now)
    told = {"alive": judged.alive, "ready": judged.ready, "problems": judged.problems, "notes": judged.notes}
    told["runbook"] = links_for([*judged.problems, *judged.notes])
    if path == "/status":
        return 200, _JSON, orjson.dumps(told | asdict(now))
    good = judged.alive if path == "/healthz" else judged.ready
    return 200 if good else 503, _JSON, orjson.dumps(told)
