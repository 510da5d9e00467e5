"""The public interface: its names, its size at import, its examples."""

import ast
import doctest
import importlib
import subprocess
import sys

import numpy as np
import pytest

import acqd
from tests.places import ROOT
from tools import api


def test_names_and_signatures_are_as_frozen():
    version, lines = api.frozen()
    assert api.listing() == lines, "python -m tools.api shows what has changed; --freeze writes it down"
    assert version.split(".")[:2] == acqd.__version__.split(".")[:2]


@pytest.mark.parametrize(
    ("before", "now", "removed", "added", "allowed"),
    [
        ("1.2.3", "1.3.0", False, True, True),
        ("1.2.3", "1.2.4", False, True, False),
        ("1.2.3", "1.3.0", True, False, False),
        ("1.2.3", "2.0.0", True, True, True),
        ("0.2.0", "0.2.1", True, False, False),
        ("0.2.0", "0.3.0", True, True, True),
        ("1.2.3", "1.2.3", False, False, True),
    ],
)
def test_a_version_says_what_has_changed(before, now, removed, added, allowed):
    assert (api.too_low(before, now, removed, added) is None) == allowed


def test_importing_acqd_imports_nothing_else():
    # how much of importlib an interpreter has imported already differs from version to version
    code = (
        "import sys, __future__, importlib; before = set(sys.modules); import acqd; print(*set(sys.modules) - before)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["acqd"], done.stdout


def test_a_meter_or_a_robot_needs_no_extra():
    code = (
        "import sys, acqd; acqd.Meter(20_000); acqd.Robot('ur3e'); "
        "print(*{'scipy', 'pyarrow', 'pandas', 'matplotlib', 'sqlalchemy', 'typer', 'torch'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not done.stdout.split(), done.stdout


def test_the_types_name_what_the_package_exports():
    stub = ast.parse((ROOT / "acqd" / "__init__.pyi").read_text())
    imported = {
        (alias.asname, node.module) for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    rooms = {(name, place.rpartition(".")[0]) for name, place in acqd._ROOMS.items()}
    exported = {(name, place) for name, place in acqd._PLACES.items()} | rooms
    assert imported == exported
    assert set(dir(acqd)) >= {name for name, _ in exported}
    with pytest.raises(AttributeError, match="no_such_name"):
        acqd.no_such_name  # noqa: B018


_MODULES = ["dataset", "estimator", "logs", "meter", "mlflow", "models", "robot", "rows"]


@pytest.mark.parametrize("module", [*_MODULES, pytest.param("loop", marks=pytest.mark.slow)])
def test_examples_in_docstrings(module, folder):
    needs = {
        "dataset": ("pandas",),
        "rows": ("pandas",),
        "estimator": ("pandas", "sklearn"),
        "mlflow": ("mlflow", "pandas"),
    }
    for needed in needs.get(module, ()):
        pytest.importorskip(needed)
    names = {name: getattr(acqd, name) for name in acqd.__all__} | {"np": np}
    runner, finder = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS), doctest.DocTestFinder(exclude_empty=True)
    examples = finder.find(importlib.import_module(f"acqd.api.{module}"), extraglobs=names)
    said: list[str] = []
    for example in examples:
        runner.run(example, out=said.append)
    assert not runner.failures, "".join(said)
    assert runner.tries, "no example"


@pytest.mark.slow
def test_examples_of_the_page_about_python(folder):
    pytest.importorskip("pandas")
    failed, tried = doctest.testfile(str(ROOT / "docs" / "python.md"), module_relative=False)
    assert not failed and tried > 10
