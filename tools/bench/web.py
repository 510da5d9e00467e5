"""The live page: first paint, weight, lag behind the row, a chart of a day, and what 20 viewers cost."""

from __future__ import annotations

import asyncio
import contextlib
import json
import shutil
import statistics
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np
import paho.mqtt.client as paho
import psutil
from paho.mqtt.enums import CallbackAPIVersion

from acqd.errors import OperationError
from acqd.storage.database import open_database, transaction
from acqd.storage.schema import power_1min
from acqd.telemetry.broker import free_port
from acqd.telemetry.row import CHANNELS, parse_row
from tools.bench.report import Figure
from tools.common.commands import acqd_command
from tools.common.servers import mosquitto

_SETTLE_S, _SECONDS, _LOADS, _VIEWERS = 3.0, 20.0, 5, 20
_LATE_US = 500
_WATCH = """() => { globalThis.updates = []; const show = numbers; numbers = () => {
  show(); const row = latest.total ?? latest.L1; if (row) updates.push([row.boot, row.seq, Date.now()]); }; }"""
_DAY = """async () => { view.seconds = 86400; const begin = performance.now(); await load();
  await new Promise(requestAnimationFrame); return [performance.now() - begin, series.time.length, series.from]; }"""


def page() -> Iterator[Figure]:
    """`acqd run` with three phases and `acqd web` together, through mosquitto; headless Chromium."""
    section = "acqd web beside acqd run (three phases), headless Chromium"
    with mosquitto() as port, tempfile.TemporaryDirectory() as folder, _running(Path(folder), port) as (web, where):
        yield from _costs(section, web, where["web"], where["health"])
        with browser() as opened:
            yield from loads(section, opened, where["web"])
            yield from _lag(section, opened, where["web"], port)
            yield from _day(section, opened, where["web"])


@contextlib.contextmanager
def _running(folder: Path, port: int) -> Iterator[tuple[psutil.Process, dict[str, int]]]:
    """The process of the page, and the ports of page and health."""
    where = {"web": free_port(), "health": free_port()}
    database = folder / "power.sqlite"
    _day_of_rollups(str(database))
    config = folder / "acqd.toml"
    config.write_text(
        f'[mqtt]\nport = {port}\n[sink]\nembedded = true\ndatabase = "{database}"\n'
        f"[health]\nport = {where['health']}\nsink_port = 0\n[web]\nport = {where['web']}\n"
    )
    commands = [acqd_command(name, "--config", config) for name in ("run", "web")]
    processes = [subprocess.Popen(each, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) for each in commands]
    try:
        _wait(where)
        yield psutil.Process(processes[1].pid), where
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait(10)


def _wait(where: dict[str, int]) -> None:
    """Until daemon and page answer, and a few seconds more. Raises OperationError after a minute."""
    for path, port in (("/", where["web"]), ("/readyz", where["health"])):
        deadline = time.monotonic() + 60
        while not answers(port, path):
            if time.monotonic() > deadline:
                raise OperationError(f"web: no answer at port {port}{path} after a minute")
            time.sleep(0.2)
    time.sleep(_SETTLE_S)


def answers(port: int, path: str) -> bool:
    """Whether a page is there."""
    with contextlib.suppress(OSError):
        connection = HTTPConnection("127.0.0.1", port, timeout=10)
        connection.request("GET", path)
        return connection.getresponse().status == 200
    return False


def _day_of_rollups(database: str) -> None:
    """One-minute roll-ups of the last day; the rows since come from the daemon."""
    end = int(time.time()) // 60 * 60
    columns = dict.fromkeys(("Vrms", "Irms", "P", "S", "PF", "f", "W"), 100.0)
    rows = [
        {"device": "acqd", "channel": channel, "start": end - 60 * k, "rows": 1500, "flagged": 0} | columns
        for k in range(1, 1441)
        for channel in CHANNELS
    ]
    with transaction(open_database(database)) as connection:
        connection.execute(power_1min.insert(), rows)


@contextlib.contextmanager
def browser() -> Iterator[Any]:
    """Headless Chromium. Raises OperationError where there is none."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise OperationError("web: playwright is missing; make install EXTRA=browser") from None
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        raise OperationError("web: no chromium is installed")
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield started
        started.close()


def loads(section: str, browser: Any, port: int) -> Iterator[Figure]:
    """First contentful paint, and bytes of everything but data."""
    paints, weight = [], 0
    for _ in range(_LOADS):
        responses: list[Any] = []
        page = browser.new_page()
        page.on("response", lambda answer, kept=responses: kept.append(answer))  # playwright marks the handler
        page.goto(f"http://127.0.0.1:{port}/")
        page.wait_for_function("performance.getEntriesByName('first-contentful-paint').length")
        paints.append(page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime"))
        fixed = [each for each in responses if "/api/" not in each.url and "/events" not in each.url]
        weight = sum(each.request.sizes()["responseBodySize"] for each in fixed)
        page.close()
    yield Figure(section, f"first contentful paint, median of {_LOADS}", statistics.median(paints), "ms", "<= 1000")
    yield Figure(section, "page weight as transferred (without data)", weight / 1000, "kB", "<= 120")


def _lag(section: str, browser: Any, port: int, broker: int) -> Iterator[Figure]:
    """From a row's arrival at a subscriber to its number on the page."""
    arrived: dict[tuple[str, int], float] = {}
    client = paho.Client(CallbackAPIVersion.VERSION2)

    def take(*message: Any) -> None:
        row = parse_row(message[-1].payload)
        arrived.setdefault((row.boot, row.seq), time.time() * 1000)

    client.on_message = take
    client.connect("127.0.0.1", broker)
    client.subscribe("acqd/+/total/power")
    client.loop_start()
    page = browser.new_page()
    page.goto(f"http://127.0.0.1:{port}/")
    page.wait_for_selector("#state.fine")
    page.evaluate(_WATCH)
    time.sleep(_SECONDS)
    shown = page.evaluate("updates")
    client.loop_stop()
    lags = [at - arrived[boot, seq] for boot, seq, at in shown if (boot, seq) in arrived]
    name = f"number on the page behind its row, {len(lags)} updates"
    yield Figure(section, f"{name}: median", float(np.median(lags)), "ms", "<= 100")
    yield Figure(section, f"{name}: 95 %", float(np.percentile(lags, 95)), "ms")
    page.close()


def _day(section: str, browser: Any, port: int) -> Iterator[Figure]:
    page = browser.new_page()
    page.goto(f"http://127.0.0.1:{port}/")
    page.wait_for_selector("#state.fine")
    drawn, points, table = page.evaluate(_DAY)
    yield Figure(section, f"chart of 24 h from {table}, {points} points: asked to drawn", drawn, "ms", "<= 1000")


def _costs(section: str, web: psutil.Process, port: int, health: int) -> Iterator[Figure]:
    """CPU of the page's process, and how late MAIN_FAST woke, without and with viewers."""
    alone, late_alone = _share(web, health)
    threading.Thread(target=lambda: asyncio.run(_look(port, _SECONDS + 4)), daemon=True).start()
    time.sleep(2)
    watched, late_watched = _share(web, health)
    yield Figure(section, "CPU of acqd web without a viewer", alone, "% of a core")
    yield Figure(section, f"more CPU with {_VIEWERS} viewers", watched - alone, "% of a core", "<= 3")
    late = f"wake-ups of MAIN_FAST later than {_LATE_US} us"
    yield Figure(section, f"{late}, without a viewer", late_alone, "%")
    yield Figure(section, f"{late}, with {_VIEWERS} viewers", late_watched, "%")


def _share(web: psutil.Process, health: int) -> tuple[float, float]:
    """CPU [% of a core] and late wake-ups [%] over some seconds."""
    before, cpu, begun = _latencies(health), sum(web.cpu_times()[:2]), time.monotonic()
    time.sleep(_SECONDS)
    spent = (sum(web.cpu_times()[:2]) - cpu) / (time.monotonic() - begun)
    counts = {upper: count - before[upper] for upper, count in _latencies(health).items()}
    late = sum(count for upper, count in counts.items() if upper > _LATE_US)
    return 100 * spent, 100 * late / max(1, sum(counts.values()))


def _latencies(port: int) -> dict[float, int]:
    """Wake-ups per upper limit [us]."""
    connection = HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request("GET", "/status")
    times = json.loads(connection.getresponse().read())["cycles"]["latency"]
    return dict(zip([*times["upper_us"], float("inf")], times["counts"], strict=True))


async def _look(port: int, seconds: float) -> None:
    async def viewer() -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while await reader.read(1 << 16):
                    pass
        writer.close()

    await asyncio.gather(*(viewer() for _ in range(_VIEWERS)))
