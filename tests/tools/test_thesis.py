"""The thesis on a tiny scale, as by hand: every step works, is done once, and tells what went wrong."""

import json
import shutil
import sys
from unittest.mock import Mock

import pytest
from rich.console import Console

from acqd.errors import OperationError, UserError
from tests.commands import module_here, without_workers
from tools.studies.thesis import __main__ as thesis
from tools.studies.thesis.steps import Step, run, seconds


@pytest.mark.minutes
def test_the_thesis_is_reproduced_and_goes_on_where_it_stood(study, tmp_path, monkeypatch, capsys):
    out = shutil.copytree(study.out, tmp_path / "out")  # the first steps
    words = [str(out), "--quick", "--json"]
    monkeypatch.setattr("tools.studies.thesis.steps.run_module", module_here)
    with without_workers():
        done = module_here(("tools.studies.thesis", *words))
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("already done") == 4
    found = json.loads(done.stdout)
    figures = [claim["figure"] for claim in found["claims"]]
    assert {"Table 7.2", "Figure 8.1", "Figure 8.16", "Figure 9.3", "Figure C.2"} <= set(figures)
    assert any(effect["id"] == "brake_release" for effect in found["use_case"]["loop"]["effects"])
    models = found["use_case"]["models"]
    assert models["grey-box, loop closed"]["predicted"]["rmse"] < 0.5 * models["grey-box"]["predicted"]["rmse"]
    page = (out / "report.html").read_text()
    assert "simulated data" in page and page.count('<details class="chapter">') == 5
    # Once more: every step is there, and only the evaluation would begin.
    monkeypatch.setattr(thesis, "evaluate", Mock(side_effect=EOFError))
    monkeypatch.setattr(sys, "argv", ["thesis", *words])
    with pytest.raises(EOFError):
        thesis.main()
    assert capsys.readouterr().err.count("already done") == 9
    monkeypatch.setattr(sys, "argv", ["thesis", *words, "--seed", "9"])
    with pytest.raises(UserError, match="another size or seed"):
        thesis.main()


def test_a_step_that_fails_says_so_and_the_next_run_goes_on(tmp_path):
    product = tmp_path / "made"
    good = Step("good", (product,), (("timeit", "-n1", "-r1", f"open({str(product)!r}, 'w').close()"),))
    bad = Step("bad", (tmp_path / "other",), (("acqd", "dataset", "show", str(tmp_path / "none")),))
    idle = Step("idle", (tmp_path / "never",), (("timeit", "-n1", "-r1", "pass"),))
    console = Console(quiet=True)
    with pytest.raises(OperationError, match="no such folder; acqd dataset build makes a dataset"):
        run([good, bad], tmp_path, console)
    with pytest.raises(OperationError, match="never was not made"):
        run([good, idle], tmp_path, console)
    assert product.exists() and list(seconds(tmp_path)) == ["good"]
