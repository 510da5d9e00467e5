"""Every device source in real time with its double in a separate process: CPU of the client, samples lost."""

from __future__ import annotations

import asyncio
import time
import tomllib
from collections.abc import Iterator
from typing import Any

import psutil
from pydantic import TypeAdapter

from acqd.daemon.source_sections import WaveformSection
from acqd.metering import Meter, WindowBatch
from acqd.plc.executive import Executive
from tests.doubles.modbus import ModbusProcess
from tests.doubles.veth import may_create_veth
from tools.bench.report import Figure
from tools.demo.devices import DEVICES, ON_ETHERNET

_SECONDS = 60.0
_WARM_UP_S = 3.0
_TITLES = {
    "ethercat": "EtherCAT, EL3783, N=100 read four times",
    "ads": "TwinCAT over ADS",
    "modbus": "waveform bridge over Modbus TCP, three phases",
    "sv": "sampled values, 4800 Hz, 2 ASDU a frame",
}
_MOST_CPU = {"modbus": 20}


def sources() -> Iterator[Figure]:
    """60 s of each source: CPU of MAIN_FAST's process, which holds the protocol's client, and the samples it lost."""
    section = f"sources in real time, {_SECONDS:g} s each, doubles on the same two cores"
    for kind, title in _TITLES.items():
        if kind in ON_ETHERNET and not may_create_veth():
            continue
        with DEVICES[kind]() as source:
            yield from _measure(section, title, source, _MOST_CPU.get(kind, 8))
    with ModbusProcess("bridge", "--phases", "1") as double:
        source = f'kind = "modbus"\nhost = "127.0.0.1"\nport = {double.port}\nconnections = 1\n'
        yield from _measure(section, "waveform bridge over Modbus TCP, one phase", source, 8)


def _measure(section: str, title: str, source: str, most_cpu: int) -> Iterator[Figure]:
    settings: WaveformSection = TypeAdapter(WaveformSection).validate_python(tomllib.loads(source))
    figures = asyncio.run(_run(settings))
    yield Figure(section, f"{title}: CPU of the client", figures["cpu"], "% of a core", f"<= {most_cpu}")
    yield Figure(section, f"{title}: samples lost", figures["lost_percent"], "%")
    yield Figure(section, f"{title}: windows without a flag", figures["clean_percent"], "%")


async def _run(settings: WaveformSection) -> dict[str, float]:
    batches: list[WindowBatch] = []
    executive = Executive(settings.spec(), Meter, batches.append)
    form = await executive.start()
    running = asyncio.create_task(executive.run())
    await asyncio.sleep(_WARM_UP_S)
    assert executive.fast_pid is not None
    client = psutil.Process(executive.fast_pid)
    batches.clear()
    before, lost_before, begun = _cpu(client), executive.health.lost, time.monotonic()
    await asyncio.sleep(_SECONDS)
    elapsed = time.monotonic() - begun
    figures: dict[str, Any] = {"cpu": 100 * (_cpu(client) - before) / elapsed}
    figures["lost_percent"] = 100 * (executive.health.lost - lost_before) / (elapsed * form.rate)
    await executive.stop()
    await running
    flags = [flags for batch in batches for flags in batch.flags[0]]
    figures["clean_percent"] = 100 * sum(not named for named in flags) / max(len(flags), 1)
    executive.close()
    return figures


def _cpu(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)
