"""`acqd jitter`: how punctual MAIN_FAST is on this host."""

from __future__ import annotations

import asyncio
from itertools import pairwise
from typing import Annotated

import numpy as np
import orjson
import typer
from rich.console import Console

from acqd.cli.folded_table import Table
from acqd.cli.options import ConfigFile, Json, configured
from acqd.daemon.modbus_sections import MetersSection
from acqd.errors import UserError
from acqd.metering import Meter
from acqd.plc.executive import Executive
from acqd.plc.realtime import RealtimeSettings
from acqd.plc.stats import CycleSummary
from acqd.report.digits import percent
from acqd.sources.spec import Spec


def jitter(
    config: ConfigFile = None,
    duration: Annotated[float, typer.Option(min=0.5, help="Seconds to measure.")] = 10.0,
    json: Json = False,
) -> None:
    """Run MAIN_FAST and MAIN_SLOW and show the wake-up latencies, like cyclictest.

    The source is the configured one, of several the first; without --config the simulated one.

    Example: acqd jitter --duration 60
    """
    settings = configured(config)
    source = settings.every_source[0]
    if isinstance(source, MetersSection):
        raise UserError('jitter: source.kind = "meters" reads registers; it has no MAIN_FAST whose cycle could jitter')
    realtime = settings.realtime.settings()
    summary, histogram, refused, slow_us = asyncio.run(_measure(source.spec(), realtime, duration))
    if json:
        bins = {str(us): int(histogram[us]) for us in np.flatnonzero(histogram)}
        report = summary.as_dict() | {"histogram_us": bins, "realtime_refused": refused, "main_slow_mean_us": slow_us}
        print(orjson.dumps(report).decode())
        return
    console = Console()
    for sentence in refused:
        console.print(f"[yellow]notice[/]: {sentence}", soft_wrap=True)
    console.print(_histogram(histogram))
    s = summary
    cycle_ms = s.period_us / 1000
    console.print(
        f"{s.cycles} cycles of {cycle_ms:g} ms, wake-up latency \\[us]: min {s.min_us}  mean {s.mean_us:.1f}  "
        f"p50 {s.p50_us}  p99 {s.p99_us}  p99.9 {s.p999_us}  max {s.max_us}\n"
        f"late (> {cycle_ms / 2:g} ms) {s.late}  missed {s.missed}  exceeded {s.exceeded}  overflow {s.overflow}  "
        f"MAIN_FAST busy {percent(s.busy)}  MAIN_SLOW {slow_us:.0f} us per window",
        soft_wrap=True,
    )


async def _measure(
    source: Spec, realtime: RealtimeSettings, duration: float
) -> tuple[CycleSummary, np.ndarray, list[str], float]:
    """Statistics and latency histogram of MAIN_FAST, refused settings, mean duration of MAIN_SLOW [us]."""
    executive = Executive(source, Meter, lambda _batch: None, realtime=realtime)
    await executive.start()
    running = asyncio.create_task(executive.run())
    await asyncio.wait({running}, timeout=duration)
    await executive.stop()
    await running
    result = executive.cycle_summary(), executive.cycle_histogram(), executive.refused, executive.slow_us()
    executive.close()
    return result


def _histogram(histogram: np.ndarray) -> Table:
    """Wake-ups per bucket of latency; each bucket is twice as wide as the one before."""
    table = Table("latency", "cycles", "", title="wake-up latency of MAIN_FAST", title_justify="left")
    edges = [0, *(2**k for k in range(1, 12))]
    total = max(int(histogram.sum()), 1)
    for low, high in pairwise(edges):
        count = int(histogram[low:high].sum())
        if count:
            table.add_row(
                f"{low}..{min(high, len(histogram)) - 1} us", str(count), "#" * max(1, round(50 * count / total))
            )
    return table
