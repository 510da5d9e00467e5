"""The notebooks, and the commands of the first ten minutes."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from acqd.errors import OperationError
from tests.places import ROOT
from tools.docs.notebooks import MACHINE_PATH, portable, run, sources_of
from tools.studies.tutorial import TRUTH

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
PAGE = ROOT / "docs" / "first-ten-minutes.md"


def code_of(path):
    """The notebook, and its code cells."""
    notebook = json.loads(path.read_text())
    return notebook, [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_stored_with_the_outputs_of_their_code_and_of_no_computer(path):
    notebook, code = code_of(path)
    assert notebook["metadata"]["acqd"]["sources"] == sources_of(notebook), "run python -m tools.docs.notebooks"
    outputs = [output for cell in code for output in cell["outputs"]]
    assert len(outputs) >= 4 and not any(output["output_type"] == "error" for output in outputs)
    for output in outputs:
        shown = {kind: words for kind, words in output.get("data", {}).items() if not kind.startswith("image/")}
        assert not MACHINE_PATH.search(json.dumps([output.get("text"), shown]))
    for cell in code:
        compile("".join(cell["source"]), path.name, "exec")


def test_the_notebook_of_the_meter_prints_what_it_is_stored_with(capsys, monkeypatch):
    monkeypatch.setattr("matplotlib.pyplot.show", lambda: None)
    _, code = code_of(ROOT / "docs" / "notebooks" / "meter-a-recording.ipynb")
    names = {}
    for cell in code[:-1]:  # the last one starts a process
        exec("".join(cell["source"]), names)
        printed = "".join("".join(output["text"]) for output in cell["outputs"] if "text" in output)
        assert capsys.readouterr().out == printed


def test_an_output_with_a_path_of_the_computer_is_refused(tmp_path):
    def cell(text):
        output = {"output_type": "stream", "name": "stdout", "text": text}
        return {"cells": [{"cell_type": "code", "source": "1", "metadata": {}, "outputs": [output]}]}

    kept = portable(cell(f"{tmp_path}/loop/report.html \x1b[1mbold\x1b[0m\n"), tmp_path)
    assert kept["cells"][0]["outputs"][0]["text"] == ["loop/report.html bold\n"]
    with pytest.raises(OperationError, match="/usr/bin/python3"):
        portable(cell("/usr/bin/python3"), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(path):
    pytest.importorskip("nbclient", reason="nbclient is not installed: pip install 'acqd[notebooks]'")
    pytest.importorskip("ipykernel")
    pytest.importorskip("pandas")
    run(path)


def commands_of(page: Path) -> list[str]:
    """The commands of the page's shell blocks, in order."""
    blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    return [line for block in blocks for line in block.splitlines() if line.startswith("acqd ")]


def test_the_first_ten_minutes_name_commands_that_exist():
    assert len(commands_of(PAGE)) >= 7
    for command in commands_of(PAGE):
        words = [word for word in command.split()[1:3] if word.islower() and "/" not in word]
        assert words, command


@pytest.mark.slow
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
