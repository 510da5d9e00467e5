"""Processes of MAIN_FAST of several boxes, forked from one that can be killed, too."""

from __future__ import annotations

import asyncio
import os
import signal
from contextlib import asynccontextmanager

import pytest

from acqd.errors import UserError
from acqd.metering import Meter
from acqd.plc.executive import Executive
from acqd.plc.forked import Nursery
from acqd.plc.realtime import RealtimeSettings
from acqd.sources import ChannelMap, SimulationSettings
from acqd.sources.spec import replay_spec, simulated_spec
from tests.waiting import LIMIT_S, finish, until


class Box:
    def __init__(self, nursery, seed):
        self.rows = 0
        spec = simulated_spec(SimulationSettings(phases=1, seed=seed)) | {"period_ms": 10}
        realtime = RealtimeSettings(priority=0)
        self.executive = Executive(spec, Meter, self.take, realtime=realtime, spawn=nursery.spawn)

    def take(self, batch):
        self.rows += len(batch)


@asynccontextmanager
async def boxes(count=2):
    nursery = Nursery()
    made = [Box(nursery, seed) for seed in range(count)]
    await asyncio.gather(*(box.executive.start() for box in made))
    running = [asyncio.create_task(box.executive.run()) for box in made]
    try:
        yield nursery, made
    finally:
        await asyncio.gather(*(box.executive.stop() for box in made))
        await asyncio.wait_for(asyncio.gather(*running), LIMIT_S)
        await nursery.close()
        for box in made:
            box.executive.close()


async def more(made, count=8):
    goals = [box.rows + count for box in made]
    await until(lambda: all(box.rows >= goal for box, goal in zip(made, goals, strict=True)), "rows of all boxes")


def private_mb(pid):
    with open(f"/proc/{pid}/smaps_rollup") as file:
        return sum(int(line.split()[1]) for line in file if line.startswith("Private_")) / 1e3


def test_boxes_share_memory_and_one_that_is_killed_comes_back_alone():
    async def scenario():
        async with boxes() as (nursery, made):
            await more(made)
            first, second = (box.executive.fast_pid for box in made)
            assert first != second and private_mb(first) < 0.75 * private_mb(os.getpid())
            os.kill(first, signal.SIGKILL)
            await until(lambda: made[0].executive.restarts == 1 and not made[0].executive.relaunching, "the relaunch")
            await more(made)
            assert made[0].executive.fast_pid != first and made[1].executive.fast_pid == second
            last = [box.executive.fast_pid for box in made]
        for pid in [nursery._process.pid, *last]:
            with pytest.raises(ProcessLookupError):
                os.kill(pid, 0)

    finish(scenario())


def test_a_killed_nursery_is_started_again_with_all_boxes():
    async def scenario():
        async with boxes() as (nursery, made):
            await more(made)
            before = [box.executive.fast_pid for box in made]
            os.kill(nursery._process.pid, signal.SIGKILL)
            await until(lambda: all(box.executive.restarts == 1 for box in made), "both relaunches")
            await more(made)
            assert not set(before) & {box.executive.fast_pid for box in made}

    finish(scenario())


def test_a_nursery_that_hangs_is_replaced(monkeypatch):
    monkeypatch.setattr("acqd.plc.forked._PATIENCE_S", 0.5)

    async def scenario():
        async with boxes(1) as (nursery, made):
            await more(made)
            hung = nursery._process.pid
            os.kill(hung, signal.SIGSTOP)
            os.kill(made[0].executive.fast_pid, signal.SIGSTOP)  # killed as one that hangs; nobody can bury it
            await until(lambda: nursery._process.pid != hung, "another nursery")
            await more(made)

    finish(scenario())


def test_a_source_that_cannot_be_used_is_said_in_one_line(tmp_path):
    async def scenario():
        nursery = Nursery()
        executive = Executive(
            replay_spec(tmp_path / "none.npz", ChannelMap(), 1), Meter, lambda _: None, spawn=nursery.spawn
        )
        with pytest.raises(UserError, match=r"none\.npz: no such file"):
            await executive.start()
        await nursery.close()

    finish(scenario())
