"""MAIN_FAST killed, hung and terminated by others: real processes, rows afterwards, the lost windows flagged."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import asdict

import numpy as np
import pytest

from acqd.metering import Meter
from acqd.plc.executive import Executive
from acqd.plc.fast_process import interpreter
from acqd.plc.realtime import RealtimeSettings
from acqd.sources import SimulationSettings
from acqd.sources.spec import simulated_spec
from tests.waiting import LIMIT_S, finish, until


class Run:
    """An executive whose rows are counted."""

    def __init__(self, before_meter=None) -> None:
        self.batches = []
        spec, realtime = simulated_spec(SimulationSettings(phases=1)), RealtimeSettings(priority=0)
        self.executive = Executive(spec, Meter, self.batches.append, realtime=realtime, before_meter=before_meter)

    @property
    def rows(self) -> int:
        return sum(map(len, self.batches))

    async def __aenter__(self) -> Run:
        await self.executive.start()
        self.running = asyncio.create_task(self.executive.run())
        await self.more(10)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.executive.stop()
        await asyncio.wait_for(self.running, LIMIT_S)
        self.executive.close()

    async def more(self, count: int) -> None:
        """Wait for new rows; the metering must not end meanwhile."""
        goal = self.rows + count
        await until(lambda: self.rows >= goal or self.running.done(), "rows")
        assert not self.running.done(), self.running.exception()

    def send(self, number: signal.Signals) -> None:
        with contextlib.suppress(ProcessLookupError):  # it is being relaunched
            os.kill(self.executive.fast_pid, number)

    def check_rows(self) -> None:
        """Windows are strictly in order, and every jump is flagged."""
        seq = np.concatenate([batch.seq for batch in self.batches])
        utc = np.concatenate([batch.utc_ns for batch in self.batches])
        flags = [flags for batch in self.batches for flags in batch.flags[0]]
        assert (np.diff(seq) > 0).all() and (np.diff(utc) > 0).all()
        jumps = np.flatnonzero(np.diff(seq) > 1)
        assert len(jumps) and all("gap" in flags[k] | flags[k + 1] for k in jumps)
        assert abs(utc[-1] - time.time_ns()) < 10e9
        # The stream's time has run on through the outage; where a busy machine has delayed rows, they say so.
        moved = np.diff(utc) - np.diff(seq) * 40_000_000
        told = np.array(["clock_step" in flags[k] | flags[k + 1] for k in range(len(moved))])
        assert np.abs(np.cumsum(np.where(told, 0, moved))).max() < 0.8e9


def child_of_this_process() -> list[int]:
    """Pids of MAIN_FAST, also while it starts."""
    with open(f"/proc/self/task/{os.getpid()}/children") as children:
        pids = [int(pid) for pid in children.read().split()]
    return [pid for pid in pids if b"acqd.plc.process" in _command(pid)]


def _command(pid: int) -> bytes:
    try:
        with open(f"/proc/{pid}/cmdline", "rb") as file:
            return file.read()
    except OSError:
        return b""


def test_killed_again_while_it_starts_main_fast_is_relaunched_and_the_metering_goes_on():
    run = Run()

    async def scenario() -> None:
        async with run:
            for _ in range(3):
                first = child_of_this_process()
                for pid in first:
                    os.kill(pid, signal.SIGKILL)
                await until(lambda: set(child_of_this_process()) - set(first), "the next process")  # noqa: B023
            await run.more(15)
            assert run.executive.restarts >= 3

    finish(scenario())
    run.check_rows()


def test_samples_wait_in_the_ring_until_the_meter_is_made():
    ended = []

    async def asked():
        await asyncio.sleep(0.3)
        ended.append(time.time_ns())

    run = Run(asked)

    async def scenario() -> None:
        async with run:
            pass

    finish(scenario())
    assert run.batches[0].utc_ns[0] < ended[0] - 0.1e9 and run.batches[0].seq[0] == 0


def test_a_failure_before_the_meter_is_made_leaves_no_process():
    async def asked():
        raise KeyError("x")

    async def scenario() -> None:
        with pytest.raises(KeyError):
            await Run(asked).executive.start()
        await until(lambda: not child_of_this_process(), "the end of MAIN_FAST")

    finish(scenario())


def test_it_ends_where_its_daemon_was_killed_before_it_could_ask_to_end_with_it():
    """Nobody else would end it, and the next start would find the device taken."""
    spec = simulated_spec(SimulationSettings(phases=1))
    realtime = asdict(RealtimeSettings(priority=0, lock_memory=False))
    wake = os.eventfd(0)
    orders = {"source": spec, "window": 0.04, "realtime": realtime, "resume": None, "wake_fd": wake}
    ring = os.memfd_create("ring")
    process = subprocess.Popen(
        interpreter("acqd.plc.process", json.dumps(orders | {"ring_fd": ring})),
        stdout=subprocess.PIPE,
        pass_fds=(ring, wake),
    )
    process.stdout.close()
    try:
        assert process.wait(LIMIT_S) == 1
    finally:
        process.kill()
        os.close(ring)
        os.close(wake)


def test_a_stopped_main_fast_is_killed_and_relaunched():
    run = Run()

    async def scenario() -> None:
        async with run:
            stopped = run.executive.fast_pid
            run.send(signal.SIGSTOP)
            await until(lambda: run.executive.fast_pid != stopped, "the next process")
            await run.more(15)
            assert run.executive.restarts == 1

    finish(scenario())
    run.check_rows()


def test_main_fast_stopped_while_it_starts_is_relaunched_too():
    run = Run()

    async def scenario() -> None:
        async with run:
            first = child_of_this_process()
            run.send(signal.SIGKILL)
            await until(lambda: set(child_of_this_process()) - set(first), "the next process")
            for pid in set(child_of_this_process()) - set(first):
                os.kill(pid, signal.SIGSTOP)
            goal = run.rows + 15
            await until(lambda: run.rows >= goal, "rows")

    finish(scenario())
    run.check_rows()


def test_a_stranger_s_sigterm_to_main_fast_does_not_end_the_metering():
    run = Run()

    async def scenario() -> None:
        async with run:
            run.send(signal.SIGTERM)
            await until(lambda: run.executive.restarts == 1, "the restart")
            await run.more(15)

    finish(scenario())
    run.check_rows()


def plant_fault(method, fault, folder, monkeypatch):
    """A statement that `method` of the simulated source executes in the fast process while the returned file exists."""
    when = folder / "now"
    (folder / "sitecustomize.py").write_text(
        "import os, sys, time\n"
        "if 'acqd.plc.process' in ' '.join(sys.orig_argv):\n"
        "    import acqd.sources.simulated as s\n"
        "    from acqd.errors import UserError\n"
        f"    def {method}(self):\n"
        f"        if os.path.exists({str(when)!r}):\n"
        f"            {fault}\n"
        f"    s.SimulatedSource.{method} = {method}\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]))
    return when


def test_a_main_fast_that_does_not_cycle_is_killed_and_relaunched(tmp_path, monkeypatch):
    """A driver that never returns: the process runs, its heartbeat stands still."""
    fault = f"os.unlink({str(tmp_path / 'now')!r}), time.sleep(1000)"
    hang = plant_fault("exchange", fault, tmp_path, monkeypatch)
    run = Run()

    async def scenario() -> None:
        async with run:
            hang.touch()
            await until(lambda: run.executive.restarts, "the restart")
            await run.more(15)
            assert run.executive.restarts == 1

    finish(scenario())
    run.check_rows()


def test_a_source_that_cannot_be_used_at_a_relaunch_is_tried_again(tmp_path, monkeypatch):
    """The cabinet's power fails: device and process are gone together, and the device comes back last."""
    away = plant_fault("connect", "raise UserError('the device does not answer')", tmp_path, monkeypatch)
    run = Run()

    async def scenario() -> None:
        async with run:
            away.touch()
            run.send(signal.SIGKILL)
            await until(lambda: not run.executive.health.connected, "the loss is said")
            assert "does not answer" in run.executive.health.reason
            away.unlink()
            await run.more(15)
            assert run.executive.health.connected

    finish(scenario())
    run.check_rows()


@pytest.mark.parametrize("moment_s", [0.0, 0.25])
def test_stopping_while_main_fast_is_being_relaunched_ends_at_once(moment_s):
    async def scenario() -> None:
        run = Run()
        await run.__aenter__()
        run.send(signal.SIGKILL)
        await until(lambda: run.executive.restarts, "the restart")
        await asyncio.sleep(moment_s)
        await asyncio.wait_for(run.__aexit__(), LIMIT_S)

    finish(scenario())


def test_killed_during_the_first_start_it_is_started_again():
    run = Run()

    async def scenario() -> None:
        starting = asyncio.create_task(run.executive.start())
        await until(child_of_this_process, "the process")
        for pid in child_of_this_process():
            os.kill(pid, signal.SIGKILL)
        await asyncio.wait_for(starting, LIMIT_S)
        run.running = asyncio.create_task(run.executive.run())
        await run.more(5)
        await run.__aexit__()

    finish(scenario())


def test_a_process_whose_parent_is_gone_already_ends_at_once():
    """The kernel tells of a parent that dies after the process has asked, and of no other."""
    late = "from acqd.plc.realtime import die_with_parent; import os; die_with_parent({}); print('lives')"
    gone, there = (
        subprocess.run([sys.executable, "-c", late.format(pid)], capture_output=True, text=True, check=False)
        for pid in (2**22, os.getpid())
    )
    assert gone.returncode == -signal.SIGTERM and not gone.stdout and there.stdout == "lives\n"
