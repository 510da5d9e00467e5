"""What the kernel says about its clock."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from acqd.plc.kernel_clock import KernelClock, WallClockSteps, kernel_synchronised


@pytest.mark.parametrize(("answer", "flags"), [(True, set()), (False, {"unsynchronised"}), (None, set())])
def test_rows_are_flagged_while_the_kernel_calls_its_clock_unsynchronised(answer, flags):
    assert KernelClock(lambda: answer).flags() == flags


def test_the_kernel_is_asked_once_a_second():
    now, asked = 0.0, []
    clock = KernelClock(lambda: bool(asked.append(now)), lambda: now)
    for tick in range(100):
        now = tick * 0.04
        clock.flags()
    assert len(asked) == 4


def test_the_answer_agrees_with_adjtimex_8():
    if shutil.which("adjtimex") is None:
        pytest.skip("no adjtimex(8) here")
    shown = subprocess.run(["adjtimex", "--print"], capture_output=True, text=True, check=True).stdout
    status = int(next(line.split()[1] for line in shown.splitlines() if "status:" in line))
    assert kernel_synchronised() == (not status & 0x40)


def test_the_call_works_here_or_says_that_nobody_can_tell():
    assert kernel_synchronised() in (True, False, None)


def test_a_set_wall_clock_is_noticed_and_a_slewed_one_is_not():
    steps, monotonic = WallClockSteps(), 0
    for second in range(100):
        monotonic = second * 10**9
        assert not steps.stepped(10**18 + round(monotonic * 1.0005), monotonic)
    assert steps.stepped(10**18 + monotonic - 5 * 10**9, monotonic + 10**9)
    assert not steps.stepped(10**18 + monotonic - 4 * 10**9, monotonic + 2 * 10**9)
