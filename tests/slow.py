"""Which slow tests run: those whose sources have changed since the tests last passed (ADR 77).

A slow test guards parts of acqd: `@pytest.mark.slow` the room of its folder, `@pytest.mark.slow("cli.close_loop")` the
module acqd.cli.close_loop. The sources of a part are its modules, all modules of acqd that they import at any distance
(or may import by a name made when they run), the data files beside these, and the modules of its slow tests with their
helpers in tests and tools. `RECORD` holds the digest of the sources on which the slow tests of every part passed.
"""

from __future__ import annotations

import ast
import hashlib
import re
import tempfile
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import pytest

ROOT = Path(__file__).parents[1]
RECORD = ROOT / "tests" / "slow.txt"
_HEAD = """\
# The sources on which the slow tests of a part of acqd passed, one line a part. `make test` and `make slow` write this
# file; where a line differs from the sources, or is missing, `make test` runs the slow tests of the part (ADR 77).
# Of two lines of a part, as after a merge, neither counts.
"""
_LINE = re.compile(r"^([a-z][\w.]*) (\w+)$", re.MULTILINE)
_MARK = re.compile(r"mark\.slow\b(?:\(([^)]*)\))?")
_DATA = {".c", ".css", ".h", ".html", ".js", ".json", ".toml"}
"""Kinds of files that count beside modules: what editors, builds and users leave in a folder must not."""
_BY_NAME = re.compile(r"\bimport_module\b|\bpkgutil\b")
_NAMED = re.compile(r"""["']((?:acqd|tests|tools)(?:\.\w+)+)""")
"""A module, or the package of modules, in a string."""


def room_of(path: str) -> str:
    """The room that tests/<room>/... are about."""
    return Path(path).parts[1]


def guards(tests: Path) -> dict[str, list[Path]]:
    """The modules of the slow tests of every part; `tests` is the folder of the tests."""
    found: dict[str, list[Path]] = {}
    for path in sorted(tests.rglob("*.py")):
        if path.parent == tests:  # the machinery of the tests
            continue
        for mark in _MARK.finditer(path.read_text(encoding="utf-8")):
            named = ast.literal_eval(f"({mark[1]},)") if mark[1] else (room_of(str(path.relative_to(tests.parent))),)
            for part in named:
                if path not in found.setdefault(part, []):
                    found[part].append(path)
    return dict(sorted(found.items()))


@dataclass(frozen=True)
class Sources:
    """Modules of acqd and of its tests, and which imports which."""

    graph: Any
    """Of grimp, with the packages acqd, tests and tools."""
    root: Path = ROOT
    _named: dict[str, set[str]] = field(default_factory=dict)
    """What a module may import by name: most modules are sources of many parts."""

    @classmethod
    def here(cls) -> Sources:
        """Read the modules; imports within functions count."""
        import grimp  # import-linter's; an ordinary test run does not need it

        return cls(grimp.build_graph("acqd", "tests", "tools", cache_dir=None))

    def digest(self, part: str, tests: Iterable[Path]) -> str:
        """Of the sources of `acqd.<part>`, whose slow tests are in the modules `tests`."""
        whole = hashlib.sha256()
        for path in sorted(self._files(part, tests)):
            content = hashlib.sha256(path.read_bytes()).hexdigest()
            whole.update(f"{path.relative_to(self.root).as_posix()} {content}\n".encode())
        return whole.hexdigest()[:16]

    def _files(self, part: str, tests: Iterable[Path]) -> set[Path]:
        start = f"acqd.{part}"
        modules = self._below(start)
        if not modules:
            raise ValueError(f"a slow test guards {start}, which does not exist")
        within = self.root / "tests"
        folders = {folder for path in tests for folder in path.parents if folder.is_relative_to(within)}
        paths = [*tests, *(path for folder in folders if (path := folder / "conftest.py").exists())]
        names = {".".join(path.relative_to(self.root).with_suffix("").parts) for path in paths}
        files = {
            self._file(module) for module in self._reached(modules, "acqd") | self._reached(names, "tests", "tools")
        }
        packages = {path.parent for path in files if path.is_relative_to(self.root / "acqd")}
        files |= {other for package in packages for other in _data(package)}
        return files | {self.root / "constraints.txt"}

    def _below(self, package: str) -> set[str]:
        """The package, or module, and all modules in it."""
        return {module for module in self.graph.modules if module == package or module.startswith(f"{package}.")}

    def _reached(self, modules: set[str], *roots: str) -> set[str]:
        """These modules and those of the packages `roots` that their import runs, at any distance."""
        reached, waiting = set(modules), list(modules)
        while waiting:
            module = waiting.pop()
            above = module.rpartition(".")[0]  # a package is imported before its modules
            imported = self.graph.find_modules_directly_imported_by(module)
            if module not in self._named:
                self._named[module] = self._by_name(module)
            for each in {*imported, *([above] if above else []), *self._named[module]}:
                if each not in reached and each.partition(".")[0] in roots:
                    reached.add(each)
                    waiting.append(each)
        return reached

    def _by_name(self, module: str) -> set[str]:
        """Modules that no import statement names: which of them the module imports is known only when it runs.

        A module that imports by name may import all modules of the packages that its strings name, or of its own
        package where they name none. The root package does so for users, and tests for what they test, which their
        marks name. A package of tools that is a program is run as a process, or from its file.
        """
        root, _, within = module.partition(".")
        if not within:
            return set()
        file = self._file(module)
        package = module if file.name == "__init__.py" else module.rpartition(".")[0]
        found = set()
        if root == "tools" and f"{package}.__main__" in self.graph.modules:
            found |= self._below(package)
        text = file.read_text(encoding="utf-8")
        if _BY_NAME.search(text):
            own = [package] if root != "tests" else []
            for name in _NAMED.findall(text) or own:
                found |= self._below(name)
        return found

    def _file(self, module: str) -> Path:
        path = self.root.joinpath(*module.split("."))
        package = path / "__init__.py"  # the folder alone may be what a deleted package left
        return package if package.exists() else path.with_suffix(".py")


def _data(folder: Path) -> Iterable[Path]:
    """Data beside the modules of a package, with those in folders that are no packages."""
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name == "__pycache__":
            continue
        if path.is_dir():
            if not (path / "__init__.py").exists():
                yield from _data(path)
        elif path.suffix in _DATA:
            yield path


def recorded() -> dict[str, str]:
    """Digest by part. Two lines of a part, as of a conflict, record nothing."""
    if not RECORD.exists():
        return {}
    pairs = _LINE.findall(RECORD.read_text(encoding="utf-8"))
    parts = [part for part, _ in pairs]
    return {part: digest for part, digest in pairs if parts.count(part) == 1}


def record(now: Mapping[str, str], known: Iterable[str]) -> None:
    """Write the digests of `now` beside what is recorded of the other `known` parts."""
    kept = {part: digest for part, digest in recorded().items() if part in set(known)} | dict(now)
    with tempfile.TemporaryDirectory(dir=RECORD.parent, prefix=".slow-") as folder:  # two runs may write at a time
        new = Path(folder) / RECORD.name
        new.write_text(_HEAD + "".join(f"{name} {kept[name]}\n" for name in sorted(kept)), encoding="utf-8")
        new.replace(RECORD)


@dataclass
class Outcomes:
    """What the slow tests of one run said."""

    done: dict[str, set[str]] = field(default_factory=dict)
    """By part: tests that passed, or were skipped because the machine lacks something."""
    failed: set[str] = field(default_factory=set)
    """Parts."""
    of: dict[str, int] = field(default_factory=dict)
    """By part: how many slow tests it has."""

    def add(self, test: str, parts: Mapping[str, int], outcome: str, last: bool) -> None:
        """The report of one phase of a test that guards `parts`; `last`: of its end."""
        for part, count in parts.items():
            self.of[part] = count
            if outcome == "failed":
                self.failed.add(part)
            elif last:
                self.done.setdefault(part, set()).add(test)

    def passed(self) -> list[str]:
        """Parts whose slow tests are all done, and none failed."""
        return sorted(
            part for part, count in self.of.items() if part not in self.failed and len(self.done.get(part, ())) == count
        )


class Choice:
    """The slow tests that a run of pytest takes; in the process that reports, it records what passed."""

    def __init__(
        self,
        mode: str,
        changed: Iterable[str],
        digests: Mapping[str, str],
        tests: Mapping[str, Iterable[str]],
        whole: bool,
    ) -> None:
        """`tests`: by part, the modules of its slow tests, as pytest names them; `whole`: all tests were asked for."""
        self.mode, self.changed, self.whole = mode, frozenset(changed), whole
        self._digests, self._outcomes = digests, Outcomes()
        self._tests, self._collected, self._broken = tests, set[str](), False

    @classmethod
    def of(cls, config: pytest.Config) -> Self:
        """As the options ask; a worker of pytest-xdist takes what the process decided that started it."""
        asked = any(name in config.option.markexpr for name in ("slow", "minutes"))
        mode = config.getoption("--slow") or ("all" if asked else "none")
        if hasattr(config, "workerinput"):
            return cls(mode, config.workerinput["changed"], {}, config.workerinput["tests"], whole=False)
        guarding: dict[str, list[Path]] = {}
        digests: dict[str, str] = {}
        if mode == "changed":
            sources, guarding = Sources.here(), guards(ROOT / "tests")
            digests = {part: sources.digest(part, tests) for part, tests in guarding.items()}
        known = recorded()
        changed = [part for part, digest in digests.items() if known.get(part) != digest]
        modules = {part: [_node_id(path) for path in paths if _is_collected(path)] for part, paths in guarding.items()}
        failed_first = config.getoption("lf", False)  # pytest leaves the other tests out before they are counted
        whole = config.args_source is config.ArgsSource.TESTPATHS and not failed_first
        return cls(mode, changed, digests, modules, whole)

    def apply(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Deselect the slow tests that are not asked for; the others carry what they guard."""
        if self.mode == "all":
            return
        minutes = "minutes" in config.option.markexpr
        parts = {item: _guarded(item) for item in items}
        gone = [item for item in items if self._leaves(item, parts[item], minutes)]
        count = Counter(part for item in items if minutes or not _takes_minutes(item) for part in parts[item])
        for part, tests in self._tests.items():
            if not self._collected.issuperset(tests):
                del count[part]  # nobody knows how many slow tests it has
        for item in items:
            counted = {part: count[part] for part in parts[item] if part in count}
            item.user_properties += [("slow", counted)] if counted else []
        if gone:
            config.hook.pytest_deselected(items=gone)
            items[:] = [item for item in items if item not in set(gone)]

    def _leaves(self, item: pytest.Item, parts: Iterable[str], minutes: bool) -> bool:
        if _takes_minutes(item):
            return not minutes
        return bool(parts) and not self.changed & set(parts)

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Tell a worker of pytest-xdist."""
        node.workerinput["changed"] = sorted(self.changed)
        node.workerinput["tests"] = {part: list(tests) for part, tests in self._tests.items()}

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Keep which modules were collected; one that skips itself has no tests here."""
        if report.failed:
            self._broken = True
        else:
            self._collected.add(report.nodeid)

    @pytest.hookimpl(trylast=True)
    def pytest_sessionstart(self, session: pytest.Session) -> None:
        """Say which slow tests run."""
        if self.mode == "changed" and (terminal := _terminal(session.config)):
            said = f"also of {', '.join(sorted(self.changed))}, which changed" if self.changed else "none, as recorded"
            terminal.write_line(f"slow tests: {said} (tests/slow.txt)")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep what a slow test said."""
        for name, parts in report.user_properties:
            if name == "slow":
                self._outcomes.add(report.nodeid, parts, report.outcome, report.when == "teardown")

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Record what passed on the sources that were there when the run started, if it saw all tests."""
        passed = self._outcomes.passed()
        if self.whole and self.mode == "changed" and passed and not self._broken:
            record({part: self._digests[part] for part in passed if part in self.changed}, self._digests)
            terminalreporter.write_line(f"slow tests passed of {', '.join(passed)}: commit tests/slow.txt")


CHOICE = pytest.StashKey[Choice]()


def _node_id(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def _is_collected(path: Path) -> bool:
    return path.name.startswith("test_")  # the marks in others are those of parameters


def _guarded(item: pytest.Item) -> tuple[str, ...]:
    """The parts of acqd that a slow test guards."""
    marks = list(item.iter_markers("slow"))
    return tuple(dict.fromkeys(part for mark in marks for part in mark.args or (room_of(item.nodeid),)))


def _takes_minutes(item: pytest.Item) -> bool:
    return item.get_closest_marker("minutes") is not None


def _terminal(config: pytest.Config) -> Any:
    return None if hasattr(config, "workerinput") else config.pluginmanager.get_plugin("terminalreporter")
