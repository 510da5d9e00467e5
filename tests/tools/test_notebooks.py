"""The notebooks, and the commands of the first ten minutes."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.places import ROOT
from tools.studies.tutorial import TRUTH

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
PAGE = ROOT / "docs" / "first-ten-minutes.md"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_stored_without_output_and_compile(path):
    cells = json.loads(path.read_text())["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code and not any(cell["outputs"] or cell["execution_count"] for cell in code)
    for cell in code:
        compile("".join(cell["source"]), path.name, "exec")


@pytest.mark.minutes
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(path, tmp_path):
    pytest.importorskip("nbclient", reason="nbclient is not installed: pip install 'acqd[notebooks]'")
    pytest.importorskip("ipykernel")
    pytest.importorskip("pandas")
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=1200, resources={"metadata": {"path": str(tmp_path)}}).execute()


def commands_of(page: Path) -> list[str]:
    """The commands of the page's shell blocks, in order."""
    blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    return [line for block in blocks for line in block.splitlines() if line.startswith("acqd ")]


def test_the_first_ten_minutes_name_commands_that_exist():
    assert len(commands_of(PAGE)) >= 7
    for command in commands_of(PAGE):
        words = [word for word in command.split()[1:3] if word.islower() and "/" not in word]
        assert words, command


@pytest.mark.minutes
def test_the_first_ten_minutes_run(tmp_path):
    environment = {"PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin", "COLUMNS": "120", "HOME": str(tmp_path)}
    for command in commands_of(PAGE):
        done = subprocess.run(
            command, shell=True, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{command}: {done.stderr[-2000:]}"
    report = json.loads((tmp_path / "loop" / "report.json").read_text())
    assert report["verdict"] == "effects_found" and report["effects"][0]["id"] == "payload"
    parameters = report["effects"][0]["parameters"]
    for name, truth in TRUTH.items():
        low, high = parameters[name]["ci95"]
        assert low <= truth <= high, (name, parameters[name])
    assert f"payload:mass_kg={TRUTH['mass']}" in PAGE.read_text()
    assert (tmp_path / "power.fmu").exists()
