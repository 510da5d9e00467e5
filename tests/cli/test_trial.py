"""`acqd try`: which commands run, what is hidden from them, what the command says, and that a trial goes on."""

import json
from pathlib import Path

import pytest

from acqd.cli import trial as module
from acqd.cli.lab import steps
from acqd.lab.trial.hidden import drawn
from acqd.report import Page, Verdict
from tests.commands import acqd_here, refused
from tests.report.charts import chart

SURE = {
    "id": "payload", "where": "flange", "confidence": 0.97, "family": {"members": []}, "rivals": [],
    "parameters": {"mass": {"value": 2.1, "unit": "kg", "ci95": [1.9, 2.3]}},
}  # fmt: skip


@pytest.fixture
def asked(monkeypatch):
    """Command lines that were asked for; their doubles write what the next ones read, and pages."""
    lines = []

    def run(words, show):
        lines.append([str(word) for word in words])
        show("working", 1.0)
        if words[0] == "train":
            Path(f"{words[1]}.models", "grey-box-everything-s1").mkdir(parents=True)
            return 0, ""
        loop = words[0] == "close-loop"
        folder = Path(f"{words[1]}.loop" if loop else words[words.index("--out") + 1])
        (folder / "logs" / "cell-01").mkdir(parents=True)
        (folder / "logs" / "cell-01" / "all_01.log").write_text("")
        (folder / "manifest.json").write_text("{}")
        report = {"verdict": "effects_found", "effects": [SURE], "hypotheses": []}
        (folder / "report.json").write_text(json.dumps(report))
        page = Page("A report", simulated=True, kind="closing report" if loop else "dataset")
        page.verdict(Verdict("found", "Cause found: payload (flange)"))
        page.write(folder / "report.html")
        return 0, ""

    monkeypatch.setattr(steps, "run_command", run)
    monkeypatch.setattr("acqd.lab.trial.picture.picture", lambda *_: chart())
    return lines


def test_a_trial_hides_its_change_and_tells_it_after_the_verdict(asked, tmp_path):
    done = acqd_here("try", "--out", tmp_path / "t", "--json")
    assert done.returncode == 0, done.stderr
    hidden = drawn(1)
    assert not any(hidden.change.id in word for line in asked for word in line)
    assert hidden.change.id not in done.stderr  # the commands are shown
    assert [line[:2] for line in asked[:2]] == [["lab", "campaign"]] * 2
    before, after = sorted(
        (line for line in asked if line[:2] == ["lab", "campaign"]), key=lambda line: "--settings" in line
    )
    robot = before[before.index("--seed") + 1]
    assert after[after.index("--robot-seed") + 1] == robot != after[after.index("--seed") + 1]
    said = json.loads(done.stdout)
    assert said["hidden"]["id"] == hidden.change.id == "payload" and said["answer"] == "right" and said["simulated"]
    assert said["size"]["holds"] is True and said["next"][-1] == "acqd try --seed 2"
    page = Path(said["page"]).read_text()
    assert "Cause found: payload" in page and "What was hidden" in page and "simulated data" in page
    assert all(Path(path).exists() for path in said["files"] if "truth" not in path)


def test_a_finished_trial_only_shows_its_page_and_a_folder_of_another_is_refused(asked, tmp_path):
    assert acqd_here("try", "--out", tmp_path / "t", "--no-browser").returncode == 0
    asked.clear()
    again = acqd_here("try", "--out", tmp_path / "t", "--no-browser")
    assert again.returncode == 0 and asked == [] and "The loop has named the hidden change." in again.stdout
    assert "another trial" in refused(acqd_here("try", "--out", tmp_path / "t", "--seed", 2))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    assert "holds no trial" in refused(acqd_here("try", "--out", tmp_path / "mine"))


def test_the_browser_is_opened_where_there_is_a_screen(asked, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr(module.webbrowser, "open", opened.append)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    done = acqd_here("try", "--out", tmp_path / "t")
    assert opened == [] and f"open {(tmp_path / 't' / 'index.html').as_uri()} in a browser" in done.stdout
    monkeypatch.setenv("DISPLAY", ":0")
    acqd_here("try", "--out", tmp_path / "t", "--no-browser")
    assert opened == []
    acqd_here("try", "--out", tmp_path / "t")
    assert opened == [(tmp_path / "t" / "index.html").as_uri()]


@pytest.mark.minutes
def test_a_trial_with_the_real_commands_holds_the_truth(tmp_path):
    done = acqd_here("try", "--out", tmp_path / "t", "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["answer"] == "right" and said["size"]["holds"]
    assert "change [W]" in Path(said["page"]).read_text()
