"""`acqd close-loop --watch`: events of the watch, one per line."""

from __future__ import annotations

import signal
import threading
from datetime import UTC, datetime

import orjson

from acqd.cli.terminal import terminal
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.watch import SHORTEST_S, Event, Watch
from acqd.report.joint_names import all_with_joint_names


def watch_loop(config: CloseConfig, every_s: float, between_s: float, *, json: bool) -> None:
    """Run until SIGINT or SIGTERM; a look in progress is finished first.

    Raises UserError, InputError.
    """
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    console = terminal()
    watch = Watch(config, between_s)
    if not json:
        console.print(f"watching {config.dataset} with {config.bundle}; proposals go to {config.out}")
    if watch.resumed is not None:
        _print(watch.resumed, json=json)
    while not stop.is_set():
        for event in watch.look(lambda *_: None):
            _print(event, json=json)
            if stop.is_set():
                return
        stop.wait(every_s)


def _print(event: Event, *, json: bool) -> None:
    line = orjson.dumps({"event": event.kind, **event.details}, option=orjson.OPT_SERIALIZE_NUMPY).decode()
    print(line if json else sentence(event), flush=True)


def sentence(event: Event) -> str:
    """An event in a line for people."""
    details = event.details
    if event.kind == "resumed":
        alarm = details["alarm"]
        since = "no alarm" if alarm is None else f"alarm since {_when(alarm['onset_s'])}"
        done = ", a proposal is written" if details["proposed"] else ""
        return f"resuming: {details['recordings']} recordings are known, {since}{done}"
    if event.kind == "recording":
        short = "" if details["judged"] else f"; too short for the charts, which need {SHORTEST_S:g} s without a gap"
        return f"{details['recording']}: residual {details['rmse']:.2f} W RMS{short}"
    if event.kind == "alarm":
        chart = details["chart"] + (f", joint {details['joint']}" if "joint" in details else "")
        return f"ALARM: the residual has changed since about {_when(details['onset_s'])} ({chart})"
    if event.kind == "trouble":
        return f"{details['reason']}; retrying"
    if "reason" in details:
        return f"no proposal yet from {details['recordings']} recordings: {details['reason']}"
    details = all_with_joint_names(details, details.get("joint_names", ()))
    named = ", ".join(f"{effect['id']} ({effect['where']})" for effect in details["effects"])
    unnamed = f"without a name: {details['correction']['follows']}" if details["correction"] else ""
    if details["verdict"] != "effects_found":
        perhaps = f", perhaps {named}" if named else f", {unnamed}" if unnamed else ""
        return f"{details['verdict']} from {details['recordings']} recordings{perhaps}: {details['out']}/report.html"
    also = f"; {unnamed}" if unnamed else ""
    return (
        f"PROPOSAL from {details['recordings']} recordings: {named}{also}; RMSE {details['before']['rmse']:.2f} -> "
        f"{details['after']['rmse']:.2f} W; look at {details['out']}/report.html, then use {details['out']}/model"
    )


def _when(unix_s: float) -> str:
    return datetime.fromtimestamp(unix_s, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
