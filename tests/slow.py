"""Which slow tests run: those whose sources have changed since the tests last passed (ADR 77).

A slow test guards parts of acqd: `@pytest.mark.slow` the room of its folder, `@pytest.mark.slow("cli.close_loop")` the
module acqd.cli.close_loop. The sources of a part are its modules, all modules of acqd that they import at any distance,
the data files beside these, and the modules of its slow tests with their helpers. `RECORD` holds the digest of the
sources on which the slow tests of every part passed.
"""

from __future__ import annotations

import ast
import hashlib
import re
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
    """Of grimp, with the packages acqd and tests."""
    root: Path = ROOT

    @classmethod
    def here(cls) -> Sources:
        """Read the modules; imports within functions count."""
        import grimp  # import-linter's; an ordinary test run does not need it

        return cls(grimp.build_graph("acqd", "tests", cache_dir=None))

    def digest(self, part: str, tests: Iterable[Path]) -> str:
        """Of the sources of `acqd.<part>`, whose slow tests are in the modules `tests`."""
        whole = hashlib.sha256()
        for path in sorted(self._files(part, tests)):
            content = hashlib.sha256(path.read_bytes()).hexdigest()
            whole.update(f"{path.relative_to(self.root).as_posix()} {content}\n".encode())
        return whole.hexdigest()[:16]

    def _files(self, part: str, tests: Iterable[Path]) -> set[Path]:
        start = f"acqd.{part}"
        modules = {m for m in self.graph.modules if m == start or m.startswith(f"{start}.")}
        if not modules:
            raise ValueError(f"a slow test guards {start}, which does not exist")
        within = self.root / "tests"
        folders = {folder for path in tests for folder in path.parents if folder.is_relative_to(within)}
        paths = [*tests, *(path for folder in folders if (path := folder / "conftest.py").exists())]
        names = {".".join(path.relative_to(self.root).with_suffix("").parts) for path in paths}
        files = {self._file(module) for module in self._reached(modules, "acqd") | self._reached(names, "tests")}
        packages = {path.parent for path in files if path.is_relative_to(self.root / "acqd")}
        files |= {other for package in packages for other in _data(package)}
        return files | {self.root / "constraints.txt"}

    def _reached(self, modules: set[str], package: str) -> set[str]:
        """These modules and those of the package that their import runs, at any distance."""
        reached, waiting = set(modules), list(modules)
        while waiting:
            module = waiting.pop()
            above = module.rpartition(".")[0]  # a package is imported before its modules
            for each in {*self.graph.find_modules_directly_imported_by(module), *([above] if above else [])}:
                if each not in reached and each.partition(".")[0] == package:
                    reached.add(each)
                    waiting.append(each)
        return reached

    def _file(self, module: str) -> Path:
        path = self.root.joinpath(*module.split("."))
        return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def _data(folder: Path) -> Iterable[Path]:
    """Files beside the modules of a package that are no modules, with those in folders that are no packages."""
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name == "__pycache__":
            continue
        if path.is_dir():
            if not (path / "__init__.py").exists():
                yield from _data(path)
        elif path.suffix not in (".py", ".pyc"):
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
    new = RECORD.with_suffix(".part")
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

    def __init__(self, mode: str, changed: Iterable[str], digests: Mapping[str, str], whole: bool) -> None:
        self.mode, self.changed, self.whole = mode, frozenset(changed), whole
        self._digests, self._outcomes = digests, Outcomes()

    @classmethod
    def of(cls, config: pytest.Config) -> Self:
        """As the options ask; a worker of pytest-xdist takes what the process decided that started it."""
        asked = any(name in config.option.markexpr for name in ("slow", "minutes"))
        mode = config.getoption("--slow") or ("all" if asked else "none")
        if hasattr(config, "workerinput"):
            return cls(mode, config.workerinput["changed"], {}, whole=False)
        digests: dict[str, str] = {}
        if mode == "changed":
            sources = Sources.here()
            digests = {part: sources.digest(part, tests) for part, tests in guards(ROOT / "tests").items()}
        known = recorded()
        changed = [part for part, digest in digests.items() if known.get(part) != digest]
        return cls(mode, changed, digests, config.args_source is config.ArgsSource.TESTPATHS)

    def apply(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Deselect the slow tests that are not asked for; the others carry what they guard."""
        if self.mode == "all":
            return
        parts = {item: _guarded(item) for item in items}
        count = Counter(part for guarded in parts.values() for part in guarded)
        minutes = "minutes" in config.option.markexpr
        gone = [item for item in items if self._leaves(item, parts[item], minutes)]
        for item in items:
            item.user_properties += [("slow", {part: count[part] for part in parts[item]})] if parts[item] else []
        if gone:
            config.hook.pytest_deselected(items=gone)
            items[:] = [item for item in items if item not in set(gone)]

    def _leaves(self, item: pytest.Item, parts: Iterable[str], minutes: bool) -> bool:
        if item.get_closest_marker("minutes"):
            return not minutes
        return bool(parts) and not self.changed & set(parts)

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Tell a worker of pytest-xdist."""
        node.workerinput["changed"] = sorted(self.changed)

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
        if self.whole and self.mode == "changed" and passed:
            record({part: self._digests[part] for part in passed if part in self.changed}, self._digests)
            terminalreporter.write_line(f"slow tests passed of {', '.join(passed)}: commit tests/slow.txt")


CHOICE = pytest.StashKey[Choice]()


def _guarded(item: pytest.Item) -> tuple[str, ...]:
    """The parts of acqd that a slow test guards."""
    marks = list(item.iter_markers("slow"))
    return tuple(dict.fromkeys(part for mark in marks for part in mark.args or (room_of(item.nodeid),)))


def _terminal(config: pytest.Config) -> Any:
    return None if hasattr(config, "workerinput") else config.pluginmanager.get_plugin("terminalreporter")
