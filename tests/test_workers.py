"""Tasks in several processes."""

from __future__ import annotations

import os
import signal
import time
from functools import partial

import pytest

from acqd.errors import OperationError
from acqd.workers import run_here_as_well


def test_every_task_is_done_once_and_this_process_takes_its_share():
    found = list(run_here_as_well(_slow_square, list(range(12)), 2))
    assert sorted(square for square, _ in found) == [number * number for number in range(12)]
    assert {os.getpid()} < {pid for _, pid in found}


def test_a_failure_ends_the_run():
    with pytest.raises(ZeroDivisionError):
        list(run_here_as_well(_inverse, [1, 1, 0, 1], 2))


def test_a_killed_worker_is_one_line():
    with pytest.raises(OperationError, match="a worker process was killed"):
        list(run_here_as_well(partial(_end_workers, os.getpid()), list(range(8)), 2))


def _slow_square(number: int) -> tuple[int, int]:
    time.sleep(0.3)
    return number * number, os.getpid()


def _inverse(number: int) -> float:
    return 1 / number


def _end_workers(parent: int, number: int) -> int:
    if os.getpid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)
    return number
