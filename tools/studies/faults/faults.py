"""The faults: what is done, for how long, and when it is over."""

from __future__ import annotations

import os
import random
import signal
import time
from collections.abc import Callable
from contextlib import suppress

import sqlalchemy as sa

from tools.studies.faults.bed import CLOCK_CACHE_S, DEVICE, Bed
from tools.studies.faults.messages import publish
from tools.studies.faults.process import Process

Fault = Callable[[Bed, random.Random], None]
"""Disturbs the bed and returns when the disturbance is over: from then on the chain has to recover by itself."""
_FAST = b"acqd.plc.process"
_RESTART_S = (0.2, 1.0)  # systemd's RestartSec, shortened


def _pause(chance: random.Random, shortest_s: float, longest_s: float) -> None:
    time.sleep(chance.uniform(shortest_s, longest_s))


def _kill(pick: Callable[[Bed], Process]) -> Fault:
    def fault(bed: Bed, chance: random.Random) -> None:
        process = pick(bed)
        process.kill()
        _pause(chance, *_RESTART_S)
        process.start()

    return fault


def _restart(pick: Callable[[Bed], Process]) -> Fault:
    def fault(bed: Bed, chance: random.Random) -> None:
        process = pick(bed)
        process.stop()
        _pause(chance, *_RESTART_S)
        process.start()

    return fault


def _freeze(pick: Callable[[Bed], Process]) -> Fault:
    def fault(bed: Bed, chance: random.Random) -> None:
        process = pick(bed)
        process.send(signal.SIGSTOP)
        _pause(chance, 0.1, 4.0)
        process.send(signal.SIGCONT)

    return fault


def _fast(number: signal.Signals, times: int = 1) -> Fault:
    """Signals to MAIN_FAST; nobody takes a SIGSTOP back, the daemon has to notice."""

    def fault(bed: Bed, chance: random.Random) -> None:
        for _ in range(times):
            pid = bed.daemon.child(_FAST)
            if pid is not None:
                with suppress(ProcessLookupError):
                    os.kill(pid, number)
            _pause(chance, 0.1, 0.6)

    return fault


def _cut(side: str, mode: str, reset: bool) -> Fault:
    def fault(bed: Bed, chance: random.Random) -> None:
        proxy = bed.proxies[side]
        proxy.mode = mode  # type: ignore[assignment]
        if reset:
            proxy.reset()
        _pause(chance, 0.2, 5.0)
        proxy.mode = "pass"

    return fault


def _reset(side: str) -> Fault:
    def fault(bed: Bed, chance: random.Random) -> None:
        for _ in range(chance.randint(1, 5)):
            bed.proxies[side].reset()
            _pause(chance, 0.0, 0.4)

    return fault


def _latency(side: str) -> Fault:
    def fault(bed: Bed, chance: random.Random) -> None:
        bed.proxies[side].latency_s = chance.uniform(0.05, 0.5)
        _pause(chance, 1.0, 4.0)
        bed.proxies[side].latency_s = 0.0

    return fault


def _lock(bed: Bed, chance: random.Random) -> None:
    """Somebody else's transaction holds the table."""
    with bed.engine.connect() as connection:
        if bed.kind.database == "sqlite":
            connection.exec_driver_sql("BEGIN EXCLUSIVE")
        else:
            connection.execute(sa.text("LOCK TABLE power IN ACCESS EXCLUSIVE MODE"))
        _pause(chance, 0.5, 5.0)
        connection.rollback()
        if bed.kind.database == "sqlite":
            with suppress(sa.exc.SQLAlchemyError):
                connection.exec_driver_sql("ROLLBACK")


def _database_crash(bed: Bed, chance: random.Random) -> None:
    """SIGQUIT: PostgreSQL ends at once and recovers from its log (immediate shutdown)."""
    assert bed.database is not None
    bed.database.stop(signal.SIGQUIT)
    _pause(chance, *_RESTART_S)
    bed.database.start()


def _garbage(bed: Bed, chance: random.Random) -> None:
    """Messages that are no rows: they belong into quarantine and delay nobody."""
    topic = f"acqd/{DEVICE}/L1/power"
    messages = [b"", b"{", b"[]", b"\xff" * 100, b'{"device":"' + b"x" * chance.randint(10, 300_000) + b'"}']
    publish(bed.proxies["daemon"].port, [(topic, chance.choice(messages)) for _ in range(20)])


def _oversized(bed: Bed, chance: random.Random) -> None:
    """Messages far larger than any row: nobody's memory may follow them."""
    size = chance.randint(2_000_000, 20_000_000)
    publish(bed.proxies["daemon"].port, [(f"acqd/{DEVICE}/L1/power", b"[" * size)] * 2)


def _all_killed(bed: Bed, chance: random.Random) -> None:
    """The computer is switched off and on (its disk keeps what was written)."""
    processes = [bed.daemon, bed.sink, bed.broker]
    for process in chance.sample(processes, len(processes)):
        process.kill()
    _pause(chance, *_RESTART_S)
    for process in (bed.broker, bed.sink, bed.daemon):
        process.start()


def _clock(bed: Bed, chance: random.Random) -> None:
    """The daemon's clock is set, and later set right."""
    bed.set_clock(chance.choice([-1.0, -5.0, 2.0, 30.0]))
    _pause(chance, 2.0, 5.0)
    bed.set_clock(0.0)
    time.sleep(CLOCK_CACHE_S)


def _again(bed: Bed, chance: random.Random) -> None:
    """Rows of the tape a second time: they are known."""
    lines = bed.tape.read_bytes().splitlines()[-400:]
    rows = [chance.choice(lines) for _ in range(40)] if lines else []
    publish(bed.proxies["daemon"].port, [(f"acqd/{DEVICE}/{_channel(row)}/power", row) for row in rows])


def _channel(row: bytes) -> str:
    return row.split(b'"channel":"', 1)[1].split(b'"', 1)[0].decode()


ALL: dict[str, Fault] = {
    "daemon killed": _kill(lambda bed: bed.daemon),
    "daemon restarted": _restart(lambda bed: bed.daemon),
    "daemon frozen": _freeze(lambda bed: bed.daemon),
    "MAIN_FAST killed": _fast(signal.SIGKILL),
    "MAIN_FAST killed thrice": _fast(signal.SIGKILL, 3),
    "MAIN_FAST hung": _fast(signal.SIGSTOP),
    "sink killed": _kill(lambda bed: bed.sink),
    "sink restarted": _restart(lambda bed: bed.sink),
    "sink frozen": _freeze(lambda bed: bed.sink),
    "broker killed": _kill(lambda bed: bed.broker),
    "broker restarted": _restart(lambda bed: bed.broker),
    "broker frozen": _freeze(lambda bed: bed.broker),
    "database locked": _lock,
    "database crashed": _database_crash,
    "malformed messages": _garbage,
    "duplicate messages": _again,
    "oversized messages": _oversized,
    "all killed": _all_killed,
    "clock set": _clock,
}
for _side in ("daemon", "sink"):
    ALL[f"{_side}: half-open"] = _cut(_side, "silent", reset=False)
    ALL[f"{_side}: no route"] = _cut(_side, "refuse", reset=True)
    ALL[f"{_side}: resets"] = _reset(_side)
    ALL[f"{_side}: latency"] = _latency(_side)
POSTGRES_ONLY = {"database crashed"}
FAKED_CLOCK_ONLY = {"clock set"}
