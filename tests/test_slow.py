"""Slow tests run where their sources changed, and are recorded when all of a part passed."""

import pytest

from tests import slow

pytest_plugins = ["pytester"]


IMPORTS = {
    "acqd": set(), "acqd.room": set(), "acqd.room.a": {"acqd.below.b", "numpy"}, "acqd.other": set(),
    "acqd.below": set(), "acqd.below.b": {"acqd.floor"}, "acqd.floor": set(),
    "tests": set(), "tests.room": set(), "tests.room.test_a": {"tests.help", "acqd.other"}, "tests.help": set(),
}  # fmt: skip


class Graph:
    modules = IMPORTS

    def find_modules_directly_imported_by(self, module):
        return IMPORTS[module]


FILES = (
    "constraints.txt", "acqd/__init__.py", "tests/__init__.py", "tests/room/__init__.py",
    "acqd/floor.py", "acqd/other.py", "acqd/room/__init__.py", "acqd/room/a.py", "acqd/room/k/k.c",
    "acqd/below/__init__.py", "acqd/below/b.py", "tests/help.py", "tests/room/test_a.py", "tests/room/test_b.py",
)  # fmt: skip


@pytest.fixture
def tree(tmp_path):
    for name in FILES:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    return tmp_path


@pytest.fixture
def path(tmp_path, monkeypatch):
    monkeypatch.setattr(slow, "RECORD", tmp_path / "slow.txt")
    return slow.RECORD


@pytest.mark.parametrize("name", FILES)
def test_a_part_changes_with_what_it_imports_at_any_distance_and_with_its_slow_tests(tree, name):
    sources, tests = slow.Sources(Graph(), tree), [tree / "tests" / "room" / "test_a.py"]
    before = sources.digest("room", tests)
    (tree / name).write_text("changed")
    assert (sources.digest("room", tests) != before) == (name not in ("acqd/other.py", "tests/room/test_b.py"))


def test_a_slow_test_that_guards_nothing_is_a_mistake(tree):
    with pytest.raises(ValueError, match=r"acqd\.nothing, which does not exist"):
        slow.Sources(Graph(), tree).digest("nothing", [])


def test_the_marks_of_the_test_modules_say_what_is_guarded(tree):
    (tree / "tests" / "room" / "test_a.py").write_text("@pytest.mark.slow\n@pytest.mark.slow('room.a', 'other')\n")
    (tree / "tests" / "room" / "test_b.py").write_text("@pytest.mark.slowly\nmarks=pytest.mark.slow)\n")
    a, b = (tree / "tests" / "room" / f"test_{name}.py" for name in "ab")
    assert slow.guards(tree / "tests") == {"other": [a], "room": [a, b], "room.a": [a]}


def test_a_conflict_records_nothing_of_its_part(path):
    slow.record({"b": "2", "a": "1"}, ["a", "b"])
    slow.record({"a": "3"}, ["a", "b"])
    assert slow.recorded() == {"a": "3", "b": "2"}
    slow.record({}, ["b"])  # a has no slow tests any more
    assert slow.recorded() == {"b": "2"}
    path.write_text("<<<<<<< ours\nb 2\n=======\nb 4\n>>>>>>> theirs\nc 5\n")
    assert slow.recorded() == {"c": "5"}


TESTS = """
import pytest

@pytest.mark.slow
def test_one(): pass

@pytest.mark.slow("other", "room")
@pytest.mark.parametrize("good", [True, {good}])
def test_two(good): assert good

@pytest.mark.slow("unchanged")
def test_three(): assert False

@pytest.mark.minutes
def test_four(): assert False

def test_five(): pass
"""


@pytest.mark.parametrize(("good", "whole", "written"), [(True, True, True), (False, True, False), (True, False, False)])
def test_a_part_is_recorded_when_the_whole_suite_ran_and_all_its_slow_tests_passed(
    pytester, path, good, whole, written
):
    pytester.makeini("[pytest]\nmarkers =\n  slow(part)\n  minutes\ntestpaths = tests\n")
    pytester.path.joinpath("tests", "room").mkdir(parents=True)
    pytester.path.joinpath("tests", "room", "test_a.py").write_text(TESTS.format(good=good))
    choice = slow.Choice("changed", ["room", "other"], {"room": "1", "other": "2", "unchanged": "3"}, whole)

    class Plugin:
        def pytest_collection_modifyitems(self, config, items):
            choice.apply(config, items)

    result = pytester.inline_run("-p", "no:xdist", "-p", "no:timeout", plugins=[choice, Plugin()])
    result.assertoutcome(passed=4 if good else 3, failed=0 if good else 1)
    assert slow.recorded() == ({"other": "2", "room": "1"} if written else {})
