"""Many devices through one mosquitto into PostgreSQL: what sinks store, at what cost, and that nothing is lost."""

from __future__ import annotations

import multiprocessing
import socket
import struct
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import psutil
import sqlalchemy as sa

from acqd.storage.database import open_database
from acqd.storage.schema import power
from acqd.telemetry import wire
from acqd.telemetry.row import CHANNELS, PowerRow
from acqd.telemetry.wire import V311, Hello
from acqd.timestamps import filetime, rfc3339
from tools.bench.report import Figure
from tools.common.commands import acqd_command
from tools.common.servers import mosquitto, postgres

_DEVICES, _WINDOW_S = 50, 0.04
_STEADY_S, _ROWS_AT_ONCE = 30.0, 200_000


def loads() -> Iterator[Figure]:
    """50 devices of 25 rows/s and four channels; then as fast as it goes, with one sink and with two."""
    with postgres() as url:
        section = f"{_DEVICES} devices, {_DEVICES * 4 / _WINDOW_S:.0f} rows/s for {_STEADY_S:.0f} s into PostgreSQL"
        sent, rate, cpu = _run(url, "steady", 1, int(_STEADY_S / _WINDOW_S), _WINDOW_S)
        stored = _stored(url, "steady")
        yield Figure(section, "rows lost", sent - stored, "", "<= 0")
        yield Figure(section, "stored", rate, "rows/s")
        yield Figure(section, "CPU of the sink", cpu, "% of a core", "<= 100")
        for sinks in (1, 2):
            name = f"flood{sinks}"
            section = f"{_ROWS_AT_ONCE} rows at once, {sinks} sink{'s' * (sinks > 1)}"
            sent, rate, cpu = _run(url, name, sinks, _ROWS_AT_ONCE // (4 * _DEVICES), 0.0)
            yield Figure(section, "rows lost", sent - _stored(url, name), "", "<= 0")
            yield Figure(section, "stored", rate, "rows/s", ">= 8000" if sinks == 1 else "")
            yield Figure(section, "CPU of the sinks", cpu, "% of a core")


def _run(url: str, boot: str, sinks: int, windows: int, every_s: float) -> tuple[int, float, float]:
    """Rows sent, rows/s from the first to the last stored row, CPU of the sinks [%]."""
    sent = windows * _DEVICES * 4
    with mosquitto() as port, ExitStack() as stack, tempfile.TemporaryDirectory() as folder:
        running = []
        for k in range(sinks):
            path = Path(folder) / f"{k}.toml"
            group = 'group = "g"\n' if sinks > 1 else ""
            path.write_text(f'[mqtt]\nport = {port}\n[sink]\ndatabase = "{url}"\nclient_id = "s{k}"\n{group}')
            sink = subprocess.Popen(acqd_command("sink", "--config", path), stderr=subprocess.DEVNULL)
            stack.callback(sink.wait)
            stack.callback(sink.terminate)
            running.append(psutil.Process(sink.pid))
        time.sleep(4.0)  # the sinks subscribe
        before = _cpu(running)
        sender = multiprocessing.get_context("spawn").Process(target=_send, args=(port, boot, windows, every_s))
        begun = time.monotonic()
        sender.start()
        progress = since = 0.0
        while (stored := _stored(url, boot)) < sent and (not since or time.monotonic() - since < 20):
            if stored == 0:
                begun = time.monotonic()
            if stored > progress:
                progress, since = stored, time.monotonic()
            time.sleep(0.1)
        elapsed = time.monotonic() - begun
        cpu = _cpu(running) - before
        sender.join()
    return sent, stored / elapsed, 100 * cpu / elapsed


def _send(port: int, boot: str, windows: int, every_s: float) -> None:
    """Publish with QoS 1, every packet made beforehand for a window of all devices."""
    with socket.create_connection(("127.0.0.1", port)) as sock:
        hello = Hello(V311, f"load-{boot}", 0, None, None, "load/will", b"", 0, 0, 1 << 16)
        sock.sendall(wire.connect(hello))
        threading.Thread(target=_discard, args=(sock,), daemon=True).start()
        begun = time.monotonic()
        for k in range(windows):
            sock.sendall(b"".join(_packets(boot, k)))
            time.sleep(max(0.0, begun + k * every_s - time.monotonic()) if every_s else 0.0)
        time.sleep(2.0)  # the broker reads what is under way


def _discard(sock: socket.socket) -> None:
    while sock.recv(1 << 16):
        pass


def _packets(boot: str, k: int) -> Iterator[bytes]:
    ns = 1_700_000_000_000_000_000 + k * 40_000_000
    values = (230.1, 1.2, 270.3, 276.1, 0.98, 50.01, k * 1e-6)
    for device in range(_DEVICES):
        for n, channel in enumerate(CHANNELS):
            row = PowerRow(f"d{device}", channel, boot, k, rfc3339(ns), filetime(ns), *values, [])
            number = (4 * (k * _DEVICES + device) + n) % 65_535 + 1
            yield _publish(f"acqd/d{device}/{channel}/power".encode(), row.to_json(), number)


def _publish(topic: bytes, payload: bytes, number: int) -> bytes:
    """PUBLISH of MQTT 3.1.1 with QoS 1."""
    body = struct.pack("!H", len(topic)) + topic + struct.pack("!H", number) + payload
    return b"\x32" + bytes([len(body) & 0x7F | 0x80, len(body) >> 7]) + body  # 128 to 16383 bytes


def _stored(url: str, boot: str) -> int:
    engine = open_database(url)
    with engine.connect() as connection:
        count = connection.execute(sa.select(sa.func.count()).where(power.c.boot == boot)).scalar()
    engine.dispose()
    return int(count or 0)


def _cpu(processes: list[psutil.Process]) -> float:
    return float(sum(times.user + times.system for times in (process.cpu_times() for process in processes)))
