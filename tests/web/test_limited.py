"""Connections that ask for nothing do not keep others out."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading

import pytest

uvicorn = pytest.importorskip("uvicorn")


@pytest.fixture
def port(request):
    from acqd.web.limited import LimitedProtocol

    class Small(LimitedProtocol):
        most = 20
        request_s = getattr(request, "param", 10.0)

    async def app(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})
        if scope["path"] == "/stream":
            await receive()
            gone = asyncio.ensure_future(receive())
            while not gone.done():
                await send({"type": "http.response.body", "body": b"x" * 65_536, "more_body": True})
                await asyncio.sleep(0)
            return
        await send({"type": "http.response.body", "body": b"page"})

    config = uvicorn.Config(app, port=0, http=Small, lifespan="off", log_level="warning", timeout_graceful_shutdown=1)
    server = uvicorn.Server(config)
    listening = socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=lambda: asyncio.run(server.serve([listening])), daemon=True)
    thread.start()
    yield listening.getsockname()[1]
    server.should_exit = server.force_exit = True
    thread.join(30)


def get(port):
    with socket.create_connection(("127.0.0.1", port), timeout=60) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        answer = b""
        while part := connection.recv(65_536):
            answer += part
        return answer


AGAIN = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\nGET / HT"


@pytest.mark.parametrize("sent", [b"", b"GET / HT", b"GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n", AGAIN])
def test_many_clients_that_wait_do_not_keep_one_out_that_asks(port, sent, caplog):
    waiting = []
    for _ in range(100):
        connection = socket.create_connection(("127.0.0.1", port), timeout=60)
        with contextlib.suppress(OSError):
            connection.sendall(sent)
        waiting.append(connection)
    assert b"page" in get(port) and b"page" in get(port)
    assert sum(map(is_ended, waiting)) >= 75, "descriptors are for those who ask"
    for connection in waiting:
        connection.close()
    assert len(caplog.records) <= 10


def is_ended(connection):
    """Whether the server has closed a connection, of which at most 4 MB are read."""
    connection.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        try:
            return any(not connection.recv(65_536) for _ in range(64))
        except ConnectionError:
            return True
    return False


@pytest.mark.parametrize("port", [0.1], indirect=True)
@pytest.mark.parametrize("sent", [b"", b"GET / HT"])
def test_who_does_not_ask_in_time_is_disconnected(port, sent):
    with socket.create_connection(("127.0.0.1", port), timeout=60) as connection:
        connection.sendall(sent)
        with contextlib.suppress(ConnectionError):
            assert connection.recv(1) == b""


def test_a_viewer_outlasts_clients_that_have_their_answer_and_those_of_another_address(port):
    viewer = socket.create_connection(("127.0.0.1", port), timeout=60)
    viewer.sendall(b"GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert viewer.recv(64)
    reading = threading.Thread(target=_drain, args=(viewer,), daemon=True)
    reading.start()
    others = []
    for sent in (AGAIN, b"GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n"):
        for _ in range(40):
            other = socket.create_connection(("127.0.0.1", port), timeout=60, source_address=("127.0.0.2", 0))
            with contextlib.suppress(OSError):
                other.sendall(sent)
            others.append(other)
    assert b"page" in get(port) and reading.is_alive()
    for each in (viewer, *others):
        each.close()


def _drain(connection):
    with contextlib.suppress(OSError):
        while connection.recv(65_536):
            pass
