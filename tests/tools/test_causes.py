"""The study of sets of causes, on made-up results of the foreign study."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

from acqd.discrepancy.causes.belief import NOTHING, OUTSIDE, Calibration
from acqd.discrepancy.selection.standing import LAW
from tools.studies.causes import __main__ as study
from tools.studies.causes.fit import left_out
from tools.studies.causes.standings import labels, read


def result(world, number, random):
    """A case whose cause leads by a large amount in most cases."""
    effect = ("payload", "coulomb_friction", "spring", None)[number % 4]
    evidence = {name: float(random.gamma(2.0, 3.0)) for name in ("payload", "gravity_bias", "coulomb_friction", LAW)}
    above = float(random.normal(0, 2))
    if effect is not None:
        leader = LAW if effect == "spring" else effect
        evidence[leader] += float(random.exponential(200.0))
        above += evidence[leader]
    scores = {
        "evidence": evidence,
        "moved": {name: [0.0, 0.0] for name in evidence},
        "above_nothing": above,
        "twins": {},
    }
    truth = [] if effect is None else [{"id": effect}]
    return {
        "world": world, "case": f"case-{number}", "strength": 3 if truth else 0, "truth": truth, "axes": 6,
        "report": {"causes": {"scores": scores} | said(effect, number)},
    }  # fmt: skip


def said(effect, number):
    """In half of the cases of a friction, the loop selects the friction."""
    if effect == "coulomb_friction" and number % 8 == 1:
        return {"set": [effect], "probabilities": {effect: 0.97, OUTSIDE: 0.03}, "follows": "confidence"}
    return {"set": [NOTHING], "probabilities": {NOTHING: 1.0}, "follows": "standing"}


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """Two families of plants with 80 cases each, a pair, and a case that the loop refused."""
    folder = tmp_path_factory.mktemp("study")
    random = np.random.default_rng(2)
    for world in ("axes6-short-seed1", "axes7-full-seed2"):
        results = folder / world / "base" / "results"
        results.mkdir(parents=True)
        for number in range(80):
            (results / f"case-{number}.json").write_text(json.dumps(result(world, number, random)))
    pair = result(world, 0, random) | {"truth": [{"id": "payload"}, {"id": "spring"}]}
    (results / "pair.json").write_text(json.dumps(pair))
    (results / "refused.json").write_text(json.dumps(pair | {"truth": [], "report": None}))
    return folder


def run(out, capsys, monkeypatch, *more):
    monkeypatch.setattr(sys, "argv", ["causes", str(out), "--json", *map(str, more)])
    study.main()
    return json.loads(capsys.readouterr().out)


def test_right_labels():
    assert labels([]) == {NOTHING} and labels(["spring"]) == {OUTSIDE}
    assert labels(["mechanical_power"]) == {"mechanical_power", "load_dependent_friction"}


def test_only_single_causes_that_the_loop_judged_are_read(out):
    assert len(list(read(out, "base"))) == 160


def test_a_calibration_holds_on_the_plant_that_it_has_not_seen(out, tmp_path, capsys, monkeypatch):
    told = run(out, capsys, monkeypatch, "--calibrate", tmp_path / "calibration.json")
    other = told["figures"]["calibrated on other plants"]
    assert other["all"]["cases"] == 160 and other["axes6-short"]["cases"] == 80
    assert other["all"]["coverage"] > 0.9 and other["all"]["size"] < 2.5
    assert other["all"]["probability_known"] > 0.6
    calibration = Calibration.from_json(json.loads((tmp_path / "calibration.json").read_text()))
    assert calibration.cases == {"effect": 80, OUTSIDE: 40, NOTHING: 40} and "160 simulated" in calibration.source


def test_what_follows_the_confidence_in_a_name_is_no_matter_of_calibration(out):
    rows = [row for row in read(out, "base") if row.led]
    assert len(rows) == 20
    assert [belief.members for belief in left_out(rows * 2 + list(read(out, "base")))[:20]] == [
        ("coulomb_friction",)
    ] * 20


def test_a_folder_without_results_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["causes", str(tmp_path)])
    with pytest.raises(SystemExit, match="has no results of label base"):
        study.main()
