"""`acqd lab investigate`: which commands run, in which order, and when the circle ends early."""

import json
from pathlib import Path

import pytest

from acqd.cli.lab import steps
from tests.commands import acqd_here

SURE = {"id": "payload", "where": "flange", "confidence": 0.98, "family": {"members": []}}
DOUBTED = SURE | {"confidence": 0.5}
PROMISE = {"decides": True, "right_name": {"now": 0.03, "designed": 0.83, "random": 0.11}}


def world(first, monkeypatch, fail=None):
    """Commands that only write what the next ones read; returns the list of their first words."""
    asked = []

    def run(words, show):
        asked.append(" ".join(words[:2]))
        out = Path(words[words.index("--out") + 1]) if "--out" in words else None
        if fail is not None and words[: len(fail)] == fail:
            return 2, "ds: no recording could be used"
        made = {"campaign": "report.html", "execute": "report.html", "build": "manifest.json"}.get(words[1])
        if words[0] == "close-loop":
            folder = out or Path(f"{words[1]}.loop")
            folder.mkdir()
            effects = [first] if out is None else [SURE]
            report = {"verdict": "effects_found", "effects": effects, "hypotheses": []}
            (folder / "report.json").write_text(json.dumps(report))
        elif words[0] == "next":
            folder = Path(f"{words[1]}.next")
            folder.mkdir()
            (folder / "next.json").write_text(json.dumps(PROMISE))
        elif made:
            out.mkdir()
            (out / made).write_text("")
        show("executing", 1.0)
        return 0, ""

    monkeypatch.setattr(steps, "run_command", run)
    return asked


def test_a_doubt_asks_for_a_second_session_and_a_repeated_command_goes_on(monkeypatch, tmp_path):
    asked = world(DOUBTED, monkeypatch)
    words = ("lab", "investigate", "--out", tmp_path / "c", "--undeclared", "payload:mass_kg=0.3", "--json")
    done = acqd_here(*words)
    assert done.returncode == 0, done.stderr
    ran = [line.split()[0] if line.split()[0] in ("train", "close-loop", "next") else line for line in asked]
    assert ran == [
        *("lab campaign", "lab campaign", "dataset build", "dataset build", "train", "close-loop", "next"),
        *("lab execute", "dataset build", "close-loop"),
    ]
    said = json.loads(done.stdout)
    assert "50 %" in said["first"] and "98 %" in said["both"] and said["designed"] == PROMISE and said["simulated"]
    asked.clear()
    assert acqd_here(*words).returncode == 0
    assert [line.split()[0] for line in asked] == ["train"]  # the double makes no bundle
    other = acqd_here("lab", "investigate", "--out", tmp_path / "c", "--undeclared", "payload:mass_kg=0.4")
    assert other.returncode == 2 and "holds another circle" in other.stderr


def test_a_motion_that_decides_nothing_is_not_executed(monkeypatch, tmp_path):
    asked = world(DOUBTED, monkeypatch)
    monkeypatch.setitem(PROMISE, "decides", False)
    done = acqd_here("lab", "investigate", "--out", tmp_path / "c", "--undeclared", "payload:mass_kg=0.3")
    assert done.returncode == 0 and "no motion of this length decides" in done.stdout
    assert not any(line.startswith("lab execute") for line in asked)


def test_a_name_without_doubt_needs_no_second_session(monkeypatch, tmp_path):
    asked = world(SURE, monkeypatch)
    done = acqd_here("lab", "investigate", "--out", tmp_path / "c", "--undeclared", "payload:mass_kg=3")
    assert done.returncode == 0 and "no question is left" in done.stdout
    assert not any(line.startswith("next") for line in asked)


def test_a_command_that_fails_ends_the_circle_with_its_line(monkeypatch, tmp_path):
    world(SURE, monkeypatch, fail=["dataset", "build"])
    done = acqd_here("lab", "investigate", "--out", tmp_path / "c", "--undeclared", "payload:mass_kg=3")
    assert done.returncode == 2
    assert done.stderr.strip().splitlines()[-1] == "acqd: acqd dataset: ds: no recording could be used"


@pytest.mark.parametrize("words", [(), ("--undeclared", "nosuch")])
def test_bad_input_is_one_line_and_leaves_nothing(tmp_path, words):
    done = acqd_here("lab", "investigate", "--out", tmp_path / "c", *words)
    assert done.returncode == 2 and len(done.stderr.strip().splitlines()) == 1 and not (tmp_path / "c").exists()


def test_a_command_of_a_step_tells_its_progress_and_its_last_line(monkeypatch, tmp_path):
    acqd = tmp_path / "acqd"
    lines = ['{"step":"reading","share":0.5}', '{"step": 1', "acqd: ds: no recording could be used", ""]
    script = ["#!/bin/sh", "cat >&2 <<'END'", *lines, "END", '[ "$ACQD_PROGRESS" = lines ] && exit 2', ""]
    acqd.write_text("\n".join(script))
    acqd.chmod(0o755)
    monkeypatch.setattr(steps.sys, "executable", str(acqd))
    told = []
    code, said = steps.run_command(["dataset", "build"], lambda *step: told.append(step))
    assert (code, said, told) == (2, "ds: no recording could be used", [("reading", 0.5)])
