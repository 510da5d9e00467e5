"""Every kind of report, as the commands make it, in headless Chromium: light, dark, and as wide as a phone."""

import shutil

import pytest

from tests.browser import chromium, looks, needs_chromium, serious_findings
from tests.campaigns import clocked, clocked_dataset
from tests.commands import acqd_here, module_here, without_workers
from tests.models.test_old_files import FOLDER

pytestmark = pytest.mark.browser


def compare(request, folder):
    study = request.getfixturevalue("study")
    run("compare", study.training, "--models", study.models, "--out", folder / "report.html")


def campaign(request, folder):
    shutil.copy(request.getfixturevalue("study").out / "training" / "report.html", folder)


def dataset(request, folder):
    once = request.getfixturevalue("once")
    shutil.copy(clocked_dataset(clocked("iiwa7_r800", once), once)[0] / "report.html", folder)


def close_loop(request, folder):
    shutil.copy(request.getfixturevalue("closed")[0] / "now" / "ds.loop" / "report.html", folder)


def energy(request, folder):
    """By cause, and of the work, of a dataset of an earlier version."""
    run("energy", "causes", FOLDER / "grey-box", FOLDER / "dataset", "--html", folder / "causes.html")
    run("energy", "work", FOLDER / "dataset", "--html", folder / "work.html")


def execute(request, folder):
    (folder / "t.csv").write_text("0,0,0,0,0,0,0\n20,10,10,-10,10,10,10\n")
    run("lab", "execute", folder / "t.csv", "--out", folder / "run")


def trajectories(request, folder):
    run("lab", "trajectories", "--out", folder / "t", "--limited", 1, "--all", 1)


def robot_check(request, folder):
    run("robot", "check", "ur3e", "--out", folder / "report.html")


def thesis(request, folder):
    """The use case and the thesis."""
    out = shutil.copytree(request.getfixturevalue("study").out, folder / "out")
    request.getfixturevalue("monkeypatch").setattr("tools.studies.thesis.steps.run_module", module_here)
    with without_workers():
        assert module_here(("tools.studies.thesis", str(out), "--quick")).returncode == 0
    for name in ("report.html", "use-case.html"):
        shutil.copy(out / name, folder)
    shutil.rmtree(out)


def run(*words):
    done = acqd_here(*words)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "make",
    [
        dataset, close_loop,
        *(
            pytest.param(each, marks=pytest.mark.slow)
            for each in (robot_check, compare, campaign, execute, trajectories, energy)
        ),
        pytest.param(thesis, marks=pytest.mark.minutes),
    ],
)  # fmt: skip
def test_no_report_has_a_serious_accessibility_finding(make, request, tmp_path):
    needs_chromium()
    make(request, tmp_path)
    pages = sorted(tmp_path.rglob("*.html"))
    assert pages
    with chromium() as browser:
        for view in looks(browser):
            for page in pages:
                view.goto(page.as_uri())
                view.evaluate("document.querySelectorAll('details').forEach(part => part.open = true)")
                assert serious_findings(view) == [] and view.errors == [], page
