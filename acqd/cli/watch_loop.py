"""`acqd close-loop --watch`: what a watch tells, line by line."""

from __future__ import annotations

import signal
import threading
from datetime import UTC, datetime

import orjson
from rich.console import Console

from acqd.discrepancy.config import CloseOrder
from acqd.discrepancy.monitor.watch import Event, Watch


def watch_loop(order: CloseOrder, every_s: float, between_s: float, *, json: bool) -> None:
    """Until SIGINT or SIGTERM; a look that is under way is finished first.

    Raises UserError, InputError.
    """
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    console = Console(soft_wrap=True)
    watch = Watch(order, between_s)
    if not json:
        console.print(f"watching {order.dataset} with {order.bundle}; proposals go to {order.out}", highlight=False)
    if watch.resumed is not None:
        _print(watch.resumed, json=json)
    while not stop.is_set():
        for event in watch.look(lambda *_: None):
            _print(event, json=json)
            if stop.is_set():
                return
        stop.wait(every_s)


def _print(event: Event, *, json: bool) -> None:
    line = orjson.dumps({"event": event.kind, **event.about}, option=orjson.OPT_SERIALIZE_NUMPY).decode()
    print(line if json else _told(event), flush=True)


def _told(event: Event) -> str:
    about = event.about
    if event.kind == "resumed":
        alarm = about["alarm"]
        since = "no alarm" if alarm is None else f"alarm since {_when(alarm['onset_s'])}"
        done = ", a proposal is written" if about["proposed"] else ""
        return f"going on: {about['recordings']} recordings are known, {since}{done}"
    if event.kind == "recording":
        return f"{about['recording']}: residual {about['rmse']:.2f} W RMS"
    if event.kind == "alarm":
        return f"ALARM: the residual has changed since about {_when(about['onset_s'])} ({about['chart']})"
    if event.kind == "trouble":
        return f"{about['reason']}; looking again"
    if "reason" in about:
        return f"not yet to be told from {about['recordings']} recordings: {about['reason']}"
    named = ", ".join(f"{effect['id']} ({effect['where']})" for effect in about["effects"])
    if about["verdict"] != "effects_found":
        perhaps = f", perhaps {named}" if named else ""
        return f"{about['verdict']} from {about['recordings']} recordings{perhaps}: {about['out']}/report.html"
    return (
        f"PROPOSAL from {about['recordings']} recordings: {named}; RMSE {about['before']['rmse']:.2f} -> "
        f"{about['after']['rmse']:.2f} W; look at {about['out']}/report.html, then use {about['out']}/model"
    )


def _when(unix_s: float) -> str:
    return datetime.fromtimestamp(unix_s, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
