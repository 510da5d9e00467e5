"""`acqd compare` as a user runs it."""

import json

import pytest

from tests.commands import acqd_here


@pytest.mark.long(seconds=40)
def test_models_are_trained_compared_and_the_grey_box_is_best(training, trained, tmp_path):
    models, results = trained
    assert set(results) == {
        "grey-box-everything-s1",
        "hybrid-everything-s1",
        "3conv1x5-everything-s1",
        "21x1dim-everything-s1",
        "21x1dim-everything-s2",
    }
    done = acqd_here("compare", training, "--models", models, "--out", tmp_path / "report.html", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    mae = {model["name"]: model["test"]["everything"]["mae"] for model in found["models"] + found["baselines"]}
    assert found["measured"] == "simulated" and 0.1 < found["noise_floor_W"] < 1.5
    assert found["noise_floor_W"] < mae["grey-box"] < 2.0 < min(mae["21x1dim"], mae["constant"])  # 40 epochs are few
    assert mae["hybrid"] < 1.1 * mae["grey-box"] and mae["linear physics"] < mae["constant"]
    seeds = {model["name"]: model["seeds"] for model in found["models"]}
    assert seeds["21x1dim"] == 2
    page = (tmp_path / "report.html").read_text()
    assert "simulated data" in page and page.count('<svg role="img"') >= 6 and "http" not in page
    for title in ("Figure 8.16", "Kernels of 3conv1x5", "Parameters of grey-box"):
        assert title in page
