"""Which worker takes which test."""

from collections import OrderedDict

from tests.schedule import OneWaits

COMPUTING = ["tests/api/test_a.py::test_1", "tests/lab/test_b.py::test_2"]
WAITING = ["tests/daemon/test_c.py::test_3", "tests/cli/test_run.py::test_4"]


class Worker:
    def __init__(self):
        self.sent = []

    def send_runtest_some(self, indices):
        self.sent += indices


def test_one_worker_takes_what_waits_and_whoever_has_none_left_helps_the_other():
    first, second = Worker(), Worker()
    tests = [*COMPUTING, *WAITING]
    schedule = OneWaits.__new__(OneWaits)  # without the processes
    schedule._exhausted = set()
    schedule.workqueue = OrderedDict((name, {name: False}) for name in tests)
    schedule.assigned_work = {first: {}, second: {}}
    schedule.registered_collections = {first: tests, second: tests}
    for worker in (first, second, second, second):
        schedule._assign_work_unit(worker)
    assert first.sent == [2] and second.sent == [0, 1, 3]


def test_a_module_and_a_group_stay_together():
    schedule = OneWaits.__new__(OneWaits)
    ids = ("tests/a/test_b.py::test_c[x::y]", "tests/a/test_b.py::test_d", "tests/a/test_b.py::test_e@torch")
    assert [schedule._split_scope(one) for one in ids] == ["tests/a/test_b.py", "tests/a/test_b.py", "torch"]
