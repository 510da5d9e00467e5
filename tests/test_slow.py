"""Slow tests run where their sources changed, and are recorded when all of a part passed."""

import subprocess
from pathlib import Path

import pytest

from tests import slow

pytest_plugins = ["pytester"]


IMPORTS = {
    "acqd": set(), "acqd.room": set(), "acqd.room.a": {"acqd.below.b", "numpy"}, "acqd.other": set(),
    "acqd.below": set(), "acqd.below.b": {"acqd.floor"}, "acqd.floor": set(),
    "acqd.found": set(), "acqd.found.list": set(), "acqd.found.deep": set(), "acqd.found.deep.c": set(),
    "acqd.kinds": set(), "acqd.kinds.d": {"acqd.floor"},
    "tests": set(), "tests.room": set(), "tests.room.test_a": {"tests.help", "acqd.other", "tools.study.one"},
    "tests.help": set(), "tests.later": set(),
    "tools": set(), "tools.study": set(), "tools.study.one": set(), "tools.study.two": set(),
    "tools.study.__main__": set(), "tools.other": set(),
}  # fmt: skip


class Graph:
    modules = IMPORTS

    def find_modules_directly_imported_by(self, module):
        return IMPORTS[module]


FILES = (
    "constraints.txt", "acqd/__init__.py", "tests/__init__.py", "tests/room/__init__.py",
    "acqd/floor.py", "acqd/other.py", "acqd/room/__init__.py", "acqd/room/a.py", "acqd/room/k/k.c",
    "acqd/found/__init__.py", "acqd/found/list.py", "acqd/found/deep/__init__.py", "acqd/found/deep/c.py",
    "acqd/kinds/__init__.py", "acqd/kinds/d.py",
    "tools/__init__.py", "tools/study/__init__.py", "tools/study/one.py", "tools/study/two.py",
    "tools/study/__main__.py", "tools/other.py", "tests/later.py",
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


def changes(root, sources, tests, name):
    """Whether the digest of acqd.room changes with this file."""
    before = sources.digest("room", tests)
    (root / name).parent.mkdir(exist_ok=True)
    (root / name).write_text("changed")
    return sources.digest("room", tests) != before


@pytest.mark.parametrize("name", FILES)
def test_a_part_changes_with_what_it_imports_at_any_distance_and_with_its_slow_tests(tree, name):
    sources, tests = slow.Sources(Graph(), tree), [tree / "tests" / "room" / "test_a.py"]
    unused = ("acqd/other.py", "tests/room/test_b.py", "tools/other.py", "tests/later.py")
    counts = name not in unused and not name.startswith(("acqd/found", "acqd/kinds"))
    assert changes(tree, sources, tests, name) == counts


@pytest.mark.parametrize(
    ("by_name", "reached", "code", "changed"),
    [
        ("acqd/found/list.py", "acqd.found.list", "pkgutil.iter_modules(package.__path__)", "acqd/found/deep/c.py"),
        ("acqd/found/__init__.py", "acqd.found", "import_module(f'{__name__}.{kind}')", "acqd/found/deep/c.py"),
        ("acqd/below/b.py", "acqd.below.b", "import_module(f'acqd.kinds.{kind}')", "acqd/kinds/d.py"),
        ("acqd/below/b.py", "acqd.below.b", 'ROOM = "acqd.kinds"\npkgutil.walk_packages(ROOM)', "acqd/kinds/d.py"),
        ("tools/study/two.py", "tools.study.two", "import_module('tests.later')", "tests/later.py"),
    ],
)
def test_a_part_changes_with_what_it_may_import_by_name(tree, by_name, reached, code, changed):
    imports = IMPORTS | {"acqd.room.a": {reached}}
    graph = Graph()
    graph.find_modules_directly_imported_by = imports.__getitem__
    (tree / by_name).write_text(f"{code}\n")
    assert changes(tree, slow.Sources(graph, tree), [tree / "tests" / "room" / "test_a.py"], changed)


def test_the_root_package_imports_by_name_for_users_only(tree):
    (tree / "acqd" / "__init__.py").write_text("import_module({'A': 'acqd.kinds'}[name])\n")
    assert not changes(tree, slow.Sources(Graph(), tree), [], "acqd/kinds/d.py")


@pytest.mark.parametrize("name", ["notes.orig", "a.py~", "k/k.so", "k/.k.c.swp", "a.py.rej", "__pycache__/a.c"])
def test_what_editors_and_builds_leave_changes_nothing(tree, name):
    assert not changes(tree, slow.Sources(Graph(), tree), [], f"acqd/room/{name}")


def test_a_folder_that_a_deleted_package_left_hides_no_module(tree):
    (tree / "acqd" / "below" / "b" / "__pycache__").mkdir(parents=True)
    assert changes(tree, slow.Sources(Graph(), tree), [], "acqd/below/b.py")


def test_all_kinds_of_data_in_the_package_are_known():
    listed = subprocess.run(["git", "ls-files", "acqd"], cwd=slow.ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a checkout")
    no_data = {".py", ".pyi", ".typed", ".LICENSE"}
    assert {Path(name).suffix for name in listed.stdout.splitlines()} - no_data == slow._DATA


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


def test_two_runs_record_at_a_time(path, monkeypatch):
    replace = Path.replace

    def meanwhile(new, target):
        monkeypatch.setattr(Path, "replace", replace)
        slow.record({"a": "1"}, ["a", "b"])
        return replace(new, target)

    monkeypatch.setattr(Path, "replace", meanwhile)
    slow.record({"b": "2"}, ["a", "b"])
    assert slow.recorded() == {"b": "2"}
    assert list(path.parent.iterdir()) == [path]


TESTS = """
import pytest

@pytest.mark.slow
def test_one(): pass

@pytest.mark.slow("other", "room")
@pytest.mark.parametrize("good", [True, {good}])
def test_two(good): assert good

@pytest.mark.slow("unchanged")
def test_three(): assert False

@pytest.mark.slow
@pytest.mark.minutes
def test_four(): assert False

def test_five(): pass
"""
ONE = "import pytest\n\n@pytest.mark.slow\ndef test_one(): pass\n"


def run(pytester, files, *options, whole=True):
    """The slow tests of `files` in tests/room, all of which but conftest.py guard it."""
    pytester.makeini("[pytest]\nmarkers =\n  slow(part)\n  minutes\ntestpaths = tests\n")
    room = pytester.path / "tests" / "room"
    room.mkdir(parents=True)
    for name, text in files.items():
        (room / name).write_text(text)
    modules = {part: [f"tests/room/{name}" for name in files] for part in ("room", "other", "unchanged")}
    digests = {"room": "1", "other": "2", "unchanged": "3"}
    choice = slow.Choice("changed", ["room", "other"], digests, modules, whole)

    class Plugin:
        def pytest_collection_modifyitems(self, config, items):
            choice.apply(config, items)

    return pytester.inline_run("-p", "no:xdist", "-p", "no:timeout", *options, plugins=[choice, Plugin()])


@pytest.mark.parametrize(("good", "whole", "written"), [(True, True, True), (False, True, False), (True, False, False)])
def test_a_part_is_recorded_when_the_whole_suite_ran_and_all_its_slow_tests_passed(
    pytester, path, good, whole, written
):
    result = run(pytester, {"test_a.py": TESTS.format(good=good)}, whole=whole)
    result.assertoutcome(passed=4 if good else 3, failed=0 if good else 1)
    assert slow.recorded() == ({"other": "2", "room": "1"} if written else {})


@pytest.mark.parametrize(
    ("other", "options", "written"),
    [
        (ONE, (), True),
        (ONE, ("--ignore", "tests/room/test_b.py"), False),
        ("import nothing_like_this", ("--continue-on-collection-errors",), False),
        ("import pytest\npytest.importorskip('nothing_like_this')\n", (), True),
    ],
)
def test_a_part_is_recorded_when_all_modules_of_its_slow_tests_were_collected(pytester, path, other, options, written):
    run(pytester, {"test_a.py": ONE, "test_b.py": other}, *options)
    assert slow.recorded() == ({"room": "1"} if written else {})


def test_nothing_is_recorded_after_an_error_of_collection_elsewhere(pytester, path):
    pytester.path.joinpath("tests", "else").mkdir(parents=True)
    pytester.path.joinpath("tests", "else", "test_c.py").write_text("import nothing_like_this")
    run(pytester, {"test_a.py": ONE}, "--continue-on-collection-errors")
    assert slow.recorded() == {}
