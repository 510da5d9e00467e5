"""The executive under libfaketime: the clock of its fast process is set while it meters."""

from __future__ import annotations

import asyncio
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from acqd.metering import Meter
from acqd.plc.executive import Executive
from acqd.plc.realtime import RealtimeSettings
from acqd.sources import SimulationSettings
from acqd.sources.spec import simulated_spec
from tests.waiting import finish, until


@pytest.fixture
def set_clock(tmp_path, monkeypatch):
    """Moves the wall clock of processes that start from now on by so many seconds; monotonic time is real."""
    found = sorted(Path("/usr/lib").glob("*/faketime/libfaketime.so.1"))
    if not found:
        pytest.skip("libfaketime is not installed: apt-get install libfaketime")
    offset = tmp_path / "offset"
    offset.write_text("+0")
    for name, value in {
        "LD_PRELOAD": str(found[-1]), "FAKETIME_TIMESTAMP_FILE": str(offset), "FAKETIME_NO_CACHE": "1",
        "FAKETIME_DONT_FAKE_MONOTONIC": "1", "DONT_FAKE_MONOTONIC": "1",
    }.items():  # fmt: skip
        monkeypatch.setenv(name, value)
    probe = ["python3", "-c", "import time; print(time.time_ns())"]
    if subprocess.run(probe, capture_output=True, text=True, check=False).returncode:
        pytest.skip("libfaketime does not work here")

    def move(seconds: float) -> None:
        new = offset.with_suffix(".new")
        new.write_text(f"{seconds:+}")
        os.replace(new, offset)

    return move


@pytest.mark.parametrize("step_s", [-1.0, 2.0])
def test_a_leap_second_and_a_step_by_ntp_are_flagged_and_time_only_rises(step_s, set_clock):
    batches = []

    async def scenario() -> None:
        spec = simulated_spec(SimulationSettings(phases=1))
        executive = Executive(spec, Meter, batches.append, realtime=RealtimeSettings(priority=0))
        await executive.start()
        running = asyncio.create_task(executive.run())
        await until(lambda: sum(map(len, batches)) >= 10, "rows")
        set_clock(step_s)

        def moved() -> bool:
            utc = np.concatenate([batch.utc_ns for batch in batches])
            seq = np.concatenate([batch.seq for batch in batches])
            offset = (utc - utc[0]) - (seq - seq[0]) * 40_000_000
            return abs(offset[-1] * 1e-9 - step_s) < 0.15

        await until(moved, "the stream follows the clock")
        await executive.stop()
        await running
        executive.close()

    finish(scenario())
    utc = np.concatenate([batch.utc_ns for batch in batches])
    flags = [flags for batch in batches for flags in batch.flags[0]]
    assert (np.diff(utc) > 0).all()
    assert any("clock_step" in named for named in flags)
