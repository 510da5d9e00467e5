"""The live page in a crowd: 200 devices at one broker, 20 viewers, 5,000 half requests."""

from __future__ import annotations

import asyncio
import contextlib
import resource
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path

import orjson
import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from acqd.telemetry import topics
from acqd.telemetry.broker import free_port
from acqd.telemetry.row import CHANNELS, PowerRow
from acqd.telemetry.row_message import joined
from acqd.timestamps import filetime, rfc3339
from tools.bench.report import Figure
from tools.bench.web import answers, browser, loads
from tools.common.commands import acqd_command
from tools.common.servers import mosquitto

_DEVICES, _VIEWERS, _HALF = 200, 20, 5_000
_WINDOWS_S = 2
"""Windows a second of each device: the publisher shares the computer."""
_SECONDS, _STARTED_S = 15.0, 60.0


def crowd() -> Iterator[Figure]:
    """`acqd web` alone at a mosquitto; the devices are made up, and send statuses, alarms and windows of four rows."""
    section = f"acqd web: {_DEVICES} devices (made up), {_WINDOWS_S} windows/s each, {_VIEWERS} viewers"
    with mosquitto() as broker, tempfile.TemporaryDirectory() as folder, _page(Path(folder), broker) as (port, log):
        stopped = threading.Event()
        publisher = threading.Thread(target=_publish, args=(broker, stopped), daemon=True)
        publisher.start()
        viewers = _Viewers(port)
        time.sleep(_SECONDS)
        with browser() as opened:
            yield from loads(section, opened, port)
        yield Figure(section, "viewers that lost their stream", viewers.stop(), "", "<= 0")
        yield from _half_requests(section, port)
        stopped.set()
        publisher.join()
        yield Figure(section, "lines in the log of acqd web", len(log.read_text().splitlines()), "", "<= 10")


@contextlib.contextmanager
def _page(folder: Path, broker: int) -> Iterator[tuple[int, Path]]:
    """Port of a page, and its log."""
    port, config, log = free_port(), folder / "acqd.toml", folder / "log"
    config.write_text(f'[mqtt]\nport = {broker}\n[sink]\ndatabase = "{folder}/a.sqlite"\n[web]\nport = {port}\n')
    with log.open("wb") as stderr:
        process = subprocess.Popen(acqd_command("web", "--config", config), stdout=stderr, stderr=stderr)
    try:
        deadline = time.monotonic() + _STARTED_S
        while not answers(port, "/") and time.monotonic() < deadline:
            time.sleep(0.2)
        yield port, log
    finally:
        process.terminate()
        process.wait(20)


def _publish(broker: int, stopped: threading.Event) -> None:
    """Retained statuses and alarms of all devices, then their windows for as long as wanted."""
    client = paho.Client(CallbackAPIVersion.VERSION2)
    client.connect("127.0.0.1", broker)
    client.loop_start()
    names = [f"robot{k:03d}" for k in range(_DEVICES)]
    alarm = {"chart": "cusum", "onset_s": 1.7e9, "raised_s": 1.7e9, "log": "a.csv"}
    for name in names:
        client.publish(topics.status(name), orjson.dumps({"state": "online", "boot": "b"}), retain=True)
        client.publish(topics.ALL_ALARMS.replace("+", name), orjson.dumps(alarm), retain=True)
    seq = 0
    while not stopped.wait(1 / _WINDOWS_S):
        now, seq = time.time_ns(), seq + 1
        values = (rfc3339(now), filetime(now), 230.1, 1.2, 270.3, 276.1, 0.98, 50.0, 0.0, ["simulated"])
        for name in names:
            client.publish(
                topics.window(name), joined(PowerRow(name, one, "b", seq, *values).to_json() for one in CHANNELS)
            )
    client.loop_stop()


class _Viewers:
    """Event streams, read in a thread."""

    def __init__(self, port: int) -> None:
        self._port, self._lost, self._ending = port, 0, threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._watch()), daemon=True)
        self._thread.start()

    def stop(self) -> int:
        """How many streams ended by themselves."""
        self._ending.set()
        self._thread.join()
        return self._lost

    async def _watch(self) -> None:
        await asyncio.gather(*(self._view() for _ in range(_VIEWERS)))

    async def _view(self) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", self._port)
        writer.write(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{self._port}\r\n\r\n".encode())
        while not self._ending.is_set():
            with contextlib.suppress(TimeoutError):
                if not await asyncio.wait_for(reader.read(1 << 16), 1.0):
                    self._lost += 1
                    break
        writer.close()


def _half_requests(section: str, port: int) -> Iterator[Figure]:
    """Clients that begin to ask, and wait: how long the page takes meanwhile."""
    resource.setrlimit(resource.RLIMIT_NOFILE, (resource.getrlimit(resource.RLIMIT_NOFILE)[1],) * 2)
    waiting, slowest = [], 0.0
    for k in range(_HALF):
        with contextlib.suppress(OSError):
            client = socket.create_connection(("127.0.0.1", port), 10.0)
            waiting.append(client)
            client.sendall(b"GET / HTTP/1.1\r\nHost: loc")
        if k % (_HALF // 10) == _HALF // 10 - 1:
            slowest = max(slowest, _asked(port))
    yield Figure(section, f"slowest of 10 answers during {_HALF} half requests", slowest, "s", "<= 2")
    for client in waiting:
        client.close()


def _asked(port: int) -> float:
    """Seconds until the page is there; a minute where it does not come."""
    begun = time.monotonic()
    connection = HTTPConnection("127.0.0.1", port, timeout=60)
    with contextlib.suppress(OSError):
        connection.request("GET", "/")
        if connection.getresponse().status == 200:
            return time.monotonic() - begun
    return 60.0
