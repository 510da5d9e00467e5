"""An effect is named in its own file only: everything about it is in its class."""

import ast
import re
from pathlib import Path

import pytest

import acqd
from acqd.models.effects import library

PACKAGE = Path(acqd.__file__).parent
ROOMS = ("cli", "dataset", "discrepancy", "fmu", "models", "sidecar")
CATALOGUE = PACKAGE / "models" / "effects" / "catalogue"


def strings(path):
    """String constants of a module, without docstrings and without `neighbours`."""
    tree = ast.parse(path.read_text())
    skipped = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and any(getattr(t, "id", "") == "neighbours" for t in node.targets):
            skipped |= {id(child) for child in ast.walk(node)}
    return [
        node.value for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in skipped
    ]  # fmt: skip


def files():
    for room in ROOMS:
        for path in sorted((PACKAGE / room).rglob("*.py")):
            if "lab" not in path.relative_to(PACKAGE).parts:
                yield path


@pytest.mark.parametrize("path", list(files()), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_effect_is_named_outside_its_class(path):
    own = path.stem if path.parent == CATALOGUE else ""
    foreign = [text for text in strings(path) if text in library() and text != own]
    assert not foreign, f"{path}: {foreign}"


def test_no_effect_is_named_in_c():
    for path in sorted((PACKAGE / "fmu" / "c").iterdir()):
        words = set(re.findall(r"\w+", path.read_text().lower()))
        assert not words & set(library()), path.name


def test_a_file_is_named_after_its_effect():
    assert {path.stem for path in CATALOGUE.glob("*.py")} - {"__init__"} == set(library())


@pytest.mark.parametrize("effect", library().values(), ids=lambda effect: effect.id)
def test_a_class_says_everything(effect):
    assert effect.summary and effect.equation and effect.experiment
    assert set(effect.neighbours) <= set(library()) - {effect.id}
    assert bool(effect.c_body) == effect.exported
    assert bool(effect.omitted_because) != effect.exported
    assert all(set(effect.bounds) <= set(shape) for shape in effect.shapes)
