"""The cyclic executive with real processes."""

from __future__ import annotations

import asyncio
import os
import signal
import time

import numpy as np
import pytest

from acqd.errors import UserError
from acqd.metering import Meter
from acqd.plc.executive import Executive
from acqd.plc.realtime import RealtimeSettings
from acqd.sources import SimulationSettings
from acqd.sources.spec import simulated_spec
from tests.waiting import LIMIT_S, finish, until


def executive(batches, **settings_):
    spec = simulated_spec(SimulationSettings(**settings_))
    return Executive(spec, Meter, batches.append, realtime=RealtimeSettings(priority=0))


def rows(batches):
    return sum(map(len, batches))


def joined(batches):
    """Numbers, times and flags of all rows."""
    flags = [flags for batch in batches for flags in batch.flags[0]]
    return np.concatenate([b.seq for b in batches]), np.concatenate([b.utc_ns for b in batches]), flags


def test_a_crashed_fast_process_is_restarted_and_the_gap_flagged():
    batches = []

    async def scenario():
        ex = executive(batches)
        await ex.start()
        running = asyncio.create_task(ex.run())
        await until(lambda: rows(batches) >= 10, "rows")
        os.kill(ex.fast_pid, signal.SIGKILL)
        seen = rows(batches)
        await until(lambda: rows(batches) >= seen + 15, "rows of the new process")
        await ex.stop()
        await running
        assert ex.restarts == 1
        ex.close()

    begun = time.time_ns()
    finish(scenario())
    seq, utc, flags = joined(batches)
    jump = int(np.argmax(np.diff(seq))) + 1
    assert seq[jump] - seq[jump - 1] > 1 and "gap" in flags[jump]
    assert (np.diff(seq) > 0).all() and all("simulated" in named for named in flags)
    # Time goes on by sample count and is this computer's. Rows that a busy machine delays for a second say clock_step.
    moved = (utc - utc[0]) - (seq - seq[0]) * 40_000_000
    assert all("clock_step" in flags[k] | flags[k + 1] for k in np.flatnonzero(np.diff(moved)))
    assert begun - 10**9 < utc[0] and utc[-1] < time.time_ns() + 10**9


def test_main_slow_may_be_kept_away_for_seconds():
    """A second and more lost windows while the ring held one second of samples, of which three quarters counted."""
    batches = []
    stalled_s = 0.0

    async def scenario():
        nonlocal stalled_s
        ex = executive(batches)
        await ex.start()
        running = asyncio.create_task(ex.run())
        await until(lambda: rows(batches) >= 5, "rows")
        time.sleep(1.6)
        seen = rows(batches)
        await until(lambda: rows(batches) >= seen + 30, "rows of the time in between")
        await ex.stop()
        await running
        stalled_s = ex.cycle_summary().missed * ex.period_ns * 1e-9  # MAIN_FAST itself, on a busy machine
        ex.close()

    finish(scenario())
    seq, _, _ = joined(batches)
    assert (seq[-1] - seq[0] + 1 - len(seq)) * 0.04 <= stalled_s


def clock_set_by(seconds, when):
    """A UTC that jumps in the fast process as soon as the file `when` exists, as NTP would set it."""
    return f"""
import os as _os, time as _t
_real = _t.time_ns
_t.time_ns = lambda: _real() + (int({seconds}e9) if _os.path.exists({str(when)!r}) else 0)
"""


@pytest.mark.parametrize("step_s", [30, -30])
def test_a_clock_step_reaches_the_rows_and_survives_a_crash(step_s, tmp_path, monkeypatch):
    now = tmp_path / "now"
    (tmp_path / "sitecustomize.py").write_text(clock_set_by(step_s, now))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    batches = []
    outage_s = 0.0

    async def scenario():
        nonlocal outage_s
        ex = executive(batches)
        await ex.start()
        running = asyncio.create_task(ex.run())
        await until(lambda: rows(batches) >= 10, "rows")
        before = len(batches)
        now.touch()
        await until(lambda: any("clock_step" in named for b in batches[before:] for named in b.flags[0]), "the step")
        killed, seen = time.monotonic(), rows(batches)
        os.kill(ex.fast_pid, signal.SIGKILL)
        await until(lambda: rows(batches) >= seen + 10, "rows of the new process")
        outage_s = time.monotonic() - killed
        await ex.stop()
        await running
        ex.close()

    finish(scenario())
    seq, utc, _ = joined(batches)
    # The numbers do not leap with the clock: they skip what the outage took, however long that was.
    assert (np.diff(seq) > 0).all() and np.diff(seq).max() * 0.04 < outage_s + 5
    moved = (utc - utc[0]) - (seq - seq[0]) * 40_000_000
    assert abs(moved[np.argmax(np.abs(moved))] - step_s * 1e9) < 3e9  # how exactly is tested in virtual time


def test_stopping_in_the_middle_of_a_restart_ends_the_run():
    async def scenario():
        ex = executive([])
        await ex.start()
        running = asyncio.create_task(ex.run())
        os.kill(ex.fast_pid, signal.SIGKILL)
        await until(lambda: ex.restarts, "the restart")
        await ex.stop()
        await asyncio.wait_for(running, LIMIT_S)
        ex.close()

    finish(scenario())


def test_an_unusable_source_is_a_user_error_not_a_crash(tmp_path):
    async def scenario():
        ex = Executive({"kind": "replay", "path": str(tmp_path / "no.npz"), "channels": {}, "loops": 1}, Meter, print)
        with pytest.raises(UserError, match="no such file"):
            await ex.start()

    finish(scenario())


def test_a_bug_in_main_slow_ends_the_run_loudly():
    def broken(_batch):
        raise ZeroDivisionError("planted")

    async def scenario():
        ex = Executive(simulated_spec(SimulationSettings()), Meter, broken, realtime=RealtimeSettings(priority=0))
        await ex.start()
        with pytest.raises(ZeroDivisionError):
            await asyncio.wait_for(ex.run(), LIMIT_S)
        ex.close()

    finish(scenario())
