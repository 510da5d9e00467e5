"""Tasks in several processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import partial

import pytest

from acqd.errors import OperationError
from acqd.workers import run_here_as_well
from tests.places import ROOT

SCRIPT = """
import os, sys, time
from acqd.cli.main import for_people
from acqd.workers import run_here
if __name__ != "__main__" and sys.argv[1:] == ["importing"]:
    time.sleep(2)  # a library that takes its time, in the worker

def work(task):
    os.write(1, b"working\\n")
    time.sleep(2)

def told():
    if sys.argv[1:] == ["importing"]:
        print("waiting", flush=True)

if __name__ == "__main__":
    for_people(lambda: list(run_here(work, list(range(20)), 2, told)))
"""


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


@pytest.mark.parametrize("when", ["importing", "working"])
def test_a_ctrl_c_ends_parent_and_workers_without_a_word(tmp_path, when):
    (tmp_path / "script.py").write_text(SCRIPT)
    with subprocess.Popen(
        [sys.executable, tmp_path / "script.py", when], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)}, start_new_session=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == {"importing": "waiting\n", "working": "working\n"}[when]
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate()
    assert (process.returncode, errors) == (130, "")
