"""The running daemon: CPU, memory, latency to a subscriber, punctuality compared with cyclictest.

CPU time is what counts, but caches and processor are shared with whatever else runs: the load stands beside it.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import aiomqtt
import numpy as np
import psutil

from tools.bench.quality import pqopen_share
from tools.bench.report import Figure
from tools.bench.waves import SCALE, hard_mains
from tools.common.commands import acqd_command, acqd_json
from tools.common.servers import mosquitto

_SECONDS = 30.0
_PARTS, _PART_S = 3, 20.0
_WARM_UP_S = 6.0
_BUSY_S = 600.0
_EVERYTHING = """[quality]
enabled = true
flicker = true
interharmonic_groups = true
[events]
enabled = true
"""


def daemon() -> Iterator[Figure]:
    """`acqd run` with three phases at 1 ms, mosquitto as broker, one subscriber."""
    section = "acqd run, three phases, MAIN_FAST at 1 ms, through mosquitto"
    yield from _daemon(section, "", "<= 8")


def from_file() -> Iterator[Figure]:
    """The same with codes from a file, so that the simulation of mains does not count."""
    for period_ms, rows, target in (
        (1, "channel", ""), (1, "window", "<= 5"), (10, "channel", ""), (40, "window", ""),
    ):  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            path = _codes(folder)
            source = f'[source]\nkind = "replay"\nfile = "{path}"\nloops = 0\nperiod_ms = {period_ms}\n'
            section = f"acqd run, three phases from a file, MAIN_FAST at {period_ms} ms, a message for each {rows}"
            yield from _daemon(section, source, target, rows)


def boxes() -> Iterator[Figure]:
    """One box, and eight, in a daemon: what one more box takes."""
    for count, target, memory in ((1, "<= 2.5", ""), (8, "<= 15", "<= 200")):
        with tempfile.TemporaryDirectory() as folder:
            source = f'kind = "replay"\nfile = "{_codes(folder)}"\nloops = 0\n'
            tables = "".join(f'[[source]]\ndevice = "box-{k}"\n{source}' for k in range(count))
            section = (
                f"acqd run, {_boxes(count)} of three phases from a file, MAIN_FAST at 10 ms, a message for each window"
            )
            yield from _daemon(section, tables, target, "window", memory)


def everything() -> Iterator[Figure]:
    """Rows alone, then power quality, flicker and events as well; one box, then eight; rows go into a sink's SQL.

    The daemons take turns, so that other work of the computer hits all.
    """
    for count, target in ((1, "<= 4"), (8, "<= 20")):
        section = (
            f"acqd run with everything, {_boxes(count)} of three phases from a file, MAIN_FAST at 10 ms, with a sink"
        )
        spent: dict[str, list[float]] = {"rows alone": [], "everything": []}
        for _ in range(_PARTS):
            spent["rows alone"].append(_with_a_sink(count, ""))
            spent["everything"].append(_with_a_sink(count, _EVERYTHING))
        middle = {name: statistics.median(each) for name, each in spent.items()}
        for name, percent in middle.items():
            yield Figure(section, f"CPU of the daemon, {name}", percent, "%", target if name == "everything" else "")
        ratio = statistics.median(b / a for a, b in zip(*spent.values(), strict=True))
        yield Figure(section, "everything over rows alone", ratio, "")
        more = statistics.median(b - a for a, b in zip(*spent.values(), strict=True)) / count
        peer = statistics.median(pqopen_share() for _ in range(_PARTS))
        yield Figure(section, "what a box adds, over pqopen-lib's harmonics and unbalance", more / peer, "")
        yield Figure(section, "load of the machine at the end", os.getloadavg()[0], "")


def _with_a_sink(boxes: int, tables: str) -> float:
    """CPU of a daemon's processes [% of a core] while a sink receives what the daemon publishes."""
    with mosquitto() as port, tempfile.TemporaryDirectory() as folder:
        source = f'kind = "replay"\nfile = "{_codes(folder)}"\nloops = 0\nperiod_ms = 10\nnominal_voltage = 230.0\n'
        each = [f'[[source]]\ndevice = "box-{k}"\n{source}' for k in range(boxes)]
        config = Path(folder) / "acqd.toml"
        config.write_text(
            f'state_dir = "{folder}/state"\n{"".join(each)}{tables}[mqtt]\nport = {port}\nrows = "window"\n'
            f'[sink]\ndatabase = "sqlite:///{folder}/rows.sqlite"\n'
        )
        commands = [acqd_command(name, "--config", config) for name in ("sink", "run")]
        sink, daemon = (
            subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for command in commands
        )
        try:
            time.sleep(_WARM_UP_S + boxes)
            before, begun = _cpu(daemon.pid), time.monotonic()
            time.sleep(_PART_S)
            after, seconds = _cpu(daemon.pid), time.monotonic() - begun
        finally:
            for process in (daemon, sink):
                process.terminate()
                process.wait(10)
    return (sum(after.values()) - sum(before.values())) / seconds * 100


def busy(seconds: float = _BUSY_S) -> Iterator[Figure]:
    """Four busy loops beside the daemon, whose process of MAIN_SLOW is stopped for five seconds in between."""
    section = f"acqd run, three phases from a file at 10 ms, {seconds / 60:g} min beside four busy loops (nice 15)"
    loops = [subprocess.Popen(["nice", "-n", "15", sys.executable, "-c", "while True: pass"]) for _ in range(4)]
    try:
        with mosquitto() as port, tempfile.TemporaryDirectory() as folder:
            config = Path(folder) / "acqd.toml"
            source = f'[source]\nkind = "replay"\nfile = "{_codes(folder)}"\nloops = 0\nperiod_ms = 10\n'
            config.write_text(f'{source}[mqtt]\nport = {port}\nrows = "window"\n')
            daemon = subprocess.Popen(acqd_command("run", "--config", config), stderr=subprocess.DEVNULL)
            try:
                rows = asyncio.run(_stopped_in_between(daemon.pid, port, seconds))
            finally:
                daemon.terminate()
                daemon.wait(10)
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
    load = os.getloadavg()[0]
    windows = {row["seq"] for row in rows}
    yield Figure(section, "windows", len(windows), "")
    yield Figure(section, "windows lost", max(windows) - min(windows) + 1 - len(windows), "", "<= 0")
    gaps = {row["seq"] for row in rows if "gap" in row["flags"]}
    yield Figure(section, "windows with a gap", len(gaps), "", "<= 0")
    yield Figure(section, "windows flagged late", len({row["seq"] for row in rows if "late" in row["flags"]}), "")
    yield Figure(section, "load of the machine at the end", load, "")


async def _stopped_in_between(pid: int, port: int, seconds: float) -> list[dict[str, Any]]:
    """Rows of so many seconds; MAIN_SLOW, but not MAIN_FAST, is stopped for 5 s in the middle."""
    rows: list[dict[str, Any]] = []
    await asyncio.sleep(_WARM_UP_S)

    async def stop() -> None:
        await asyncio.sleep(seconds / 2)
        os.kill(pid, signal.SIGSTOP)
        await asyncio.sleep(5.0)
        os.kill(pid, signal.SIGCONT)

    stopping = asyncio.create_task(stop())
    async with aiomqtt.Client("127.0.0.1", port) as client:
        await client.subscribe("acqd/+/window", qos=1)
        end = time.monotonic() + seconds
        async for message in client.messages:
            rows += json.loads(bytes(message.payload))
            if time.monotonic() > end:
                break
    await stopping
    return rows


def _boxes(count: int) -> str:
    return "1 box" if count == 1 else f"{count} boxes"


def _codes(folder: str) -> Path:
    path = Path(folder) / "codes.npz"
    wave = hard_mains(50.0, 3, 10.0)  # whole cycles: the loop is seamless
    u, i = wave.codes[:, 0::2].T, wave.codes[:, 1::2].T
    np.savez(path, u_code=u, i_code=i, u_V_per_digit=SCALE[0], i_A_per_digit=SCALE[1], fs=20_000)
    return path


def _daemon(section: str, source: str, target: str, rows: str = "channel", memory: str = "") -> Iterator[Figure]:
    with mosquitto() as port, tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "acqd.toml"
        config.write_text(f'{source}[mqtt]\nport = {port}\nrows = "{rows}"\n')
        process = subprocess.Popen(acqd_command("run", "--config", config), stderr=subprocess.DEVNULL)
        try:
            latencies, status, spent = asyncio.run(_measured(process.pid, port))
            family = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
            rss = sum(member.memory_info().rss for member in family) / 1e6
            pss = sum(member.memory_full_info().pss for member in family) / 1e6
        finally:
            process.terminate()
            process.wait(10)
    middle = {name: statistics.median(part[name] for part in spent) for name in spent[0]}
    yield Figure(
        section, f"CPU of all processes, median of {_PARTS} x {_PART_S:g} s", sum(middle.values()), "%", target
    )
    for name, percent in middle.items():
        yield Figure(section, f"of that {name}", percent, "% of a core")
    yield Figure(section, "load of the machine at the end", os.getloadavg()[0], "")
    yield Figure(section, "memory of all processes, shared pages counted once (PSS)", pss, "MB", memory)
    yield Figure(section, "the same, shared pages counted in each process (RSS)", rss, "MB", "" if memory else "<= 150")
    p50, p99 = np.percentile(latencies, [50, 99])
    yield Figure(section, "window's end to subscriber, p50", p50, "ms")
    yield Figure(section, "window's end to subscriber, p99", p99, "ms", "<= 15")
    yield Figure(section, "rows received", len(latencies), "")
    if "main_slow" in status:
        yield Figure(section, "MAIN_SLOW, mean of the run", status["main_slow"]["mean_us"] / 1000, "ms")


async def _measured(pid: int, port: int) -> tuple[list[float], dict[str, Any], list[dict[str, float]]]:
    """Latencies [ms], the last status, and CPU [% of a core] of MAIN_SLOW and of MAIN_FAST in each part."""
    await asyncio.sleep(_WARM_UP_S)
    listening = asyncio.create_task(_listen(port, _PARTS * _PART_S))
    parts = []
    for _ in range(_PARTS):
        before, begun = _cpu(pid), time.monotonic()
        await asyncio.sleep(_PART_S)
        after, seconds = _cpu(pid), time.monotonic() - begun
        parts.append({name: (after[name] - before[name]) / seconds * 100 for name in after})
    latencies, status = await listening
    return latencies, status, parts


def _cpu(pid: int) -> dict[str, float]:
    """CPU time so far [s]."""
    daemon = psutil.Process(pid)
    children = [_used(child) for child in daemon.children(recursive=True)]
    return {"MAIN_SLOW and MQTT": _used(daemon), "MAIN_FAST and source": sum(children)}


def _used(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


async def _listen(port: int, seconds: float) -> tuple[list[float], dict[str, Any]]:
    latencies: list[float] = []
    status: dict[str, Any] = {}
    async with aiomqtt.Client("127.0.0.1", port) as client:
        await client.subscribe("acqd/#", qos=1)
        end = time.monotonic() + seconds
        async for message in client.messages:
            now = time.time()
            content = json.loads(bytes(message.payload)) if message.payload != b"offline" else {}
            if message.topic.matches("acqd/+/+/power") or message.topic.matches("acqd/+/window"):
                for row in content if isinstance(content, list) else [content]:
                    started = datetime.fromisoformat(row["time"]).timestamp()
                    latencies.append((now - started) * 1e3 - 40.0)
            elif message.topic.matches("acqd/+/status"):
                status = content
            if time.monotonic() > end:
                break
    return latencies, status


def jitter() -> Iterator[Figure]:
    """`acqd jitter` and cyclictest at the same time, both with SCHED_FIFO, nothing else."""
    section = "wake-up latency at 1 ms, with cyclictest in the same seconds"
    cyclictest = shutil.which("cyclictest")
    peer = None
    if cyclictest:
        # The same priority, so that neither one has precedence.
        options = ["-q", "-m", "-p", "80", "-i", "1000", "-l", str(int(_SECONDS * 1000)), "-h", "4000"]
        peer = subprocess.Popen([cyclictest, *options], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    report = acqd_json("jitter", "--duration", _SECONDS)
    for name in ("p50_us", "p99_us", "p999_us", "max_us"):
        yield Figure(section, f"acqd {name.removesuffix('_us')}", report[name], "us")
    yield Figure(section, "acqd missed cycles", report["missed"], "")
    if peer is None:
        return
    counts = np.zeros(4000)
    for latency, count in re.findall(r"^(\d{6}) (\d+)", peer.communicate()[0], flags=re.MULTILINE):
        counts[min(int(latency), 3999)] += int(count)
    rank = np.cumsum(counts) / counts.sum()
    p50, p99 = (int(np.searchsorted(rank, share)) for share in (0.5, 0.99))
    yield Figure(section, "cyclictest p50", p50, "us")
    yield Figure(section, "cyclictest p99", p99, "us")
    yield Figure(section, "ratio of the p99s", report["p99_us"] / max(p99, 1), "", "<= 4")
