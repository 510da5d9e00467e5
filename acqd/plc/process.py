"""The process that MAIN_FAST runs in: `python -m acqd.plc.process` with its settings (JSON) on argv.

It makes the source, sizes the ring, answers with one line of JSON on stdout, and cycles. It holds
nothing else: no event loop, no MQTT, no SQL.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import time
from dataclasses import asdict
from typing import Any

from acqd.errors import UserError
from acqd.plc.fast import FastTask, OverrunPolicy, run_fast
from acqd.plc.realtime import RealtimeSettings, die_with_parent, engage
from acqd.plc.ring import Ring, RingLayout
from acqd.sources.spec import make_source

RING_S = 14.0
"""Seconds of samples in the ring. Three quarters of them are out of the writer's reach: MAIN_SLOW may be kept away for
10 s."""


def main() -> int:
    """Run MAIN_FAST with the settings in argv[1] (JSON)."""
    return run(json.loads(sys.argv[1]))


def run(orders: dict[str, Any]) -> int:
    """Run MAIN_FAST. Exit 0: ended or stopped; 1: its daemon is gone; 2: bad source."""
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the daemon's; it tells us when to stop
    stopping = False

    def stop(*_: Any) -> None:
        nonlocal stopping
        stopping = True

    signal.signal(signal.SIGTERM, stop)
    try:
        source = make_source(orders["source"])
        source.connect()
    except UserError as error:
        _answer({"error": str(error)})
        return 2
    form = source.form
    layout = RingLayout(form.rate, len(form.scale), int(RING_S * form.rate), form.bits)
    try:
        os.ftruncate(orders["ring_fd"], layout.bytes)
        ring = Ring(layout, orders["ring_fd"])
    except OSError as error:
        _answer({"error": f"MAIN_FAST: no memory for {layout.bytes >> 20} MB of samples ({error.strerror})"})
        return 2
    wake_fd = orders["wake_fd"]
    task = FastTask(
        source,
        ring,
        orders["window"] * form.rate,
        lambda: os.eventfd_write(wake_fd, 1),
        OverrunPolicy(),
        wake_fd,
    )
    refused = engage(RealtimeSettings(**orders["realtime"]))
    answer = {"form": asdict(form), "live": source.live, "flags": sorted(source.flags), "layout": asdict(layout)}
    if not _answer(answer | {"refused": refused, "period_ns": source.period_ns, "patience_s": source.patience_s}):
        source.close()  # killed before `die_with_parent`: nobody would ever end this process, which has the device
        return 1
    utc_ns, index = orders["source"].get("start_utc_ns") or time.time_ns(), 0
    if orders["resume"] and source.live:
        # Restarted: the old stream continues after a gap as long as the outage. The outage is measured on the
        # monotonic clock and added to the stream's time: if UTC was set meanwhile, that shows as a clock step.
        old_index, old_utc, seen = orders["resume"]
        outage_ns = time.monotonic_ns() - seen
        index, utc_ns = old_index + round(outage_ns * 1e-9 * form.rate), old_utc + outage_ns
    try:
        run_fast(task, source, ring, utc_ns=utc_ns, index=index, stop=lambda: stopping, library=orders.get("ticks"))
    finally:
        source.close()
        os.eventfd_write(wake_fd, 1)
    return 0


def _answer(message: dict[str, Any]) -> bool:
    """Whether the daemon is there to read it."""
    there = True
    try:
        print(json.dumps(message), flush=True)
    except BrokenPipeError:
        there = False
    with contextlib.suppress(BrokenPipeError):
        sys.stdout.close()
    sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - lives as long as the process
    return there


if __name__ == "__main__":
    sys.exit(main())
