"""The running daemon: CPU, memory, latency to a subscriber, punctuality compared with cyclictest."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import aiomqtt
import numpy as np
import psutil

from tools.bench.report import Figure
from tools.bench.waves import SCALE, hard_mains
from tools.common.commands import acqd_command, acqd_json
from tools.common.servers import mosquitto

_SECONDS = 30.0
_WARM_UP_S = 3.0


def daemon() -> Iterator[Figure]:
    """`acqd run` with three phases at 1 ms, mosquitto as broker, one subscriber."""
    section = "acqd run, three phases, MAIN_FAST at 1 ms, through mosquitto"
    yield from _daemon(section, "", "<= 8")


def from_file() -> Iterator[Figure]:
    """The same with codes from a file, so that the simulation of mains does not count."""
    for period_ms, rows, target in (
        (1, "channel", ""), (1, "window", "<= 5"), (10, "channel", ""), (10, "window", "<= 2.5"), (40, "window", ""),
    ):  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "codes.npz"
            wave = hard_mains(50.0, 3, 10.0)  # whole cycles: the loop is seamless
            u, i = wave.codes[:, 0::2].T, wave.codes[:, 1::2].T
            np.savez(path, u_code=u, i_code=i, u_V_per_digit=SCALE[0], i_A_per_digit=SCALE[1], fs=20_000)
            source = f'[source]\nkind = "replay"\nfile = "{path}"\nloops = 0\nperiod_ms = {period_ms}\n'
            section = f"acqd run, three phases from a file, MAIN_FAST at {period_ms} ms, a message for each {rows}"
            yield from _daemon(section, source, target, rows)


def _daemon(section: str, source: str, target: str, rows: str = "channel") -> Iterator[Figure]:
    with mosquitto() as port, tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "acqd.toml"
        config.write_text(f'{source}[mqtt]\nport = {port}\nrows = "{rows}"\n')
        process = subprocess.Popen(acqd_command("run", "--config", config), stderr=subprocess.DEVNULL)
        try:
            time.sleep(_WARM_UP_S)
            family = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
            before = _cpu(family)
            begun = time.monotonic()
            latencies, status = asyncio.run(_listen(port, _SECONDS))
            cpu = (_cpu(family) - before) / (time.monotonic() - begun) * 100
            rss = sum(member.memory_info().rss for member in family) / 1e6
            pss = sum(member.memory_full_info().pss for member in family) / 1e6
        finally:
            process.terminate()
            process.wait(10)
    yield Figure(section, "CPU of both processes (MAIN_FAST and source, MAIN_SLOW, MQTT)", cpu, "% of a core", target)
    yield Figure(section, "RSS of both processes", rss, "MB", "<= 150")
    yield Figure(section, "of that, not shared with each other (PSS)", pss, "MB")
    p50, p99 = np.percentile(latencies, [50, 99])
    yield Figure(section, "window's end to subscriber, p50", p50, "ms")
    yield Figure(section, "window's end to subscriber, p99", p99, "ms", "<= 15")
    yield Figure(section, "rows received", len(latencies), "")
    yield Figure(section, "MAIN_SLOW, mean of the run", status["main_slow"]["mean_us"] / 1000, "ms")


def _cpu(family: list[psutil.Process]) -> float:
    return float(sum(times.user + times.system for times in (member.cpu_times() for member in family)))


async def _listen(port: int, seconds: float) -> tuple[list[float], dict[str, dict[str, float]]]:
    latencies: list[float] = []
    status: dict[str, dict[str, float]] = {}
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
