"""The judgement of the study of foreign plants."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from tools.studies.foreign import __main__ as study
from tools.studies.foreign import judge, runner
from tools.studies.foreign.cases import NEED_SIGNALS, Case, World, cases, make_after
from tools.studies.foreign.generator.hidden.catalogue import ELECTRICAL, MECHANICAL, OUTSIDE
from tools.studies.foreign.picture import draw, wilson
from tools.studies.foreign.tables import changes, reliability, row, summary


def effect(name, where="joint 2", value=5.0, unit="Nm", ci95=(4.0, 6.0), confidence=0.9, parameter="torque"):
    parameters = {parameter: {"value": value, "unit": unit, "ci95": list(ci95)}}
    return {"id": name, "where": where, "parameters": parameters, "confidence": confidence}


def true(name, where="joint 2", value=5.0, unit="Nm"):
    return {"id": name, "where": where, "value": value, "unit": unit, "size": value, "strength": 0.1, "details": {}}


def result(truth, effects, verdict="effects_found", before=5.0, after=1.0, axes=7):
    report = {
        "effects": effects, "verdict": verdict, "before": {"rmse": before}, "after": {"rmse": after},
        "reference_rmse": 1.0,
    }  # fmt: skip
    return {
        "case": "x-10", "strength": 10 if truth else 0, "world": "w", "axes": axes, "truth": truth, "error": None,
        "report": report, "seconds": {"generate": 1.0}, "clock": {"ahead_s": 0.5}, "lag_errors_s": {"cycle-aa": 0.02},
    }  # fmt: skip


def test_the_first_name_decides_between_right_second_and_wrong():
    truth = [true("coulomb_friction")]
    assert judge.outcome(result(truth, [effect("coulomb_friction"), effect("thermostat")])) == "right"
    assert judge.outcome(result(truth, [effect("thermostat"), effect("coulomb_friction")])) == "second"
    assert judge.outcome(result(truth, [effect("thermostat")])) == "wrong"
    assert judge.outcome(result(truth, [], "unknown_structure")) == "unknown"
    assert judge.outcome(result(truth, [], "not_identifiable")) == "unclear"
    assert judge.outcome(result(truth, [], "nothing_left")) == "silent"


def test_a_second_name_of_one_cause_is_spurious():
    twice = result([true("payload", "flange")], [effect("payload", "flange"), effect("gravity_bias", "link 7")])
    assert judge.outcome(twice) == "right"
    assert judge.matched(twice) == ([0], [1])


def test_any_name_is_wrong_for_clean_sets_and_outside_of_the_library():
    assert judge.outcome(result([], [effect("payload")])) == "wrong"
    assert judge.outcome(result([true("spring")], [effect("payload")])) == "wrong"
    assert judge.outcome(result([true("spring")], [], "unknown_structure")) == "unknown"


def test_a_correction_counts_by_the_squared_error_above_the_reference_that_it_leaves():
    corrected = result([true("spring")], [], "unknown_structure", before=5.0, after=2.0)
    corrected["report"]["correction"] = {"follows": "a torque that depends on the angle of joint 2"}
    described = result([true("lagging_pump")], [], "unknown_structure", before=5.0, after=5.0)
    assert judge.excess_left(corrected) == pytest.approx((2.0**2 - 1) / (5.0**2 - 1))
    assert judge.excess_left(described) is None
    figures = summary([corrected, described])
    assert figures["unknown_corrected"] == {"of": 2, "hits": 1} and figures["excess_left_median"] == pytest.approx(
        1 / 8
    )


@pytest.mark.parametrize(("axes", "link", "right"), [(7, 7, True), (7, 6, True), (7, 5, False), (6, 5, True)])
def test_a_payload_may_be_called_a_weight_on_the_last_two_links(axes, link, right):
    case = result([true("payload", "flange", unit="kg")], [effect("gravity_bias", f"link {link}")], axes=axes)
    assert (judge.outcome(case) == "right") is right


def test_mechanical_power_counts_as_load_dependent_friction_only_as_a_loss():
    assert judge.accepts("load_dependent_friction", effect("mechanical_power", parameter="lost share"), 7)
    assert not judge.accepts("load_dependent_friction", effect("mechanical_power", parameter="share"), 7)


def test_every_family_has_known_names_and_a_reason():
    for family in judge.families():
        assert {family["true"], family["named"]} <= set(MECHANICAL | ELECTRICAL)
        assert len(family["reason"]) > 20


def test_intervals_are_judged_at_the_true_place_in_the_true_unit():
    truth = [true("coulomb_friction", value=5.5)]
    assert judge.intervals(result(truth, [effect("coulomb_friction")])) == [True]
    assert judge.intervals(result(truth, [effect("coulomb_friction", ci95=(4.0, 5.0))])) == [False]
    assert judge.intervals(result(truth, [effect("coulomb_friction", where="joint 3")])) == []
    on_link = [true("gravity_bias", "link 3", 2.0, "kg")]
    for where, judged in (("link 3", [True]), ("link 3, beside its centre", [True]), ("link 4", []), ("link 30", [])):
        named = effect("gravity_bias", where, 2.1, "kg", (1.5, 2.7), parameter="mass")
        assert judge.intervals(result(on_link, [named])) == judged
    assert judge.intervals(result(truth, [effect("coulomb_friction", unit="-")])) == []
    each = effect("coulomb_friction", where="each joint", parameter="torque joint 1")
    each["parameters"]["torque joint 2"] = {"value": 9.0, "unit": "Nm", "ci95": [8.0, 10.0]}
    assert judge.intervals(result(truth, [each])) == [False]


def test_pairs_need_both_names():
    truth = [true("payload", "flange"), true("coulomb_friction")]
    assert judge.both(result(truth, [effect("coulomb_friction"), effect("payload", "flange")]))
    assert not judge.both(result(truth, [effect("payload", "flange")]))


def test_the_summary_counts_what_was_asked():
    results = [
        result([true("payload", "flange")], [effect("payload", "flange", confidence=0.99)]),
        result([true("payload", "flange")], [effect("thermostat", confidence=0.92)], after=6.0),
        result([], [], "nothing_left"),
        result([], [effect("thermostat", confidence=0.94)]),
    ]
    figures = summary(results)
    assert figures["groups"]["1 single 10 %"]["right"] == 1 and figures["groups"]["1 single 10 %"]["wrong"] == 1
    assert figures["clean_named"] == {"of": 2, "hits": 1}
    assert figures["spurious"] == {"of": 2, "hits": 1}
    assert figures["lags_within_10_ms"] == {"of": 4, "hits": 0} and figures["lag_worst_ms"] == pytest.approx(20.0)
    assert figures["harm"] == {"of": 4, "hits": 1}
    assert [(row["names"], row["right"]) for row in reliability(results)] == [(2, 0.0), (1, 1.0)]


def test_a_row_for_machines_says_what_was_named_and_what_that_is_worth():
    judged = row(result([true("payload", "flange")], [effect("payload", "flange"), effect("thermostat")]))
    assert judged["outcome"] == "right" and judged["spurious"] == ["thermostat"]
    assert judged["held_out_rmse_W"] == {"before": 5.0, "after": 1.0}
    assert json.loads(json.dumps(judged))["named"][0]["parameters"]["torque"]["ci95"] == [4.0, 6.0]


def test_only_cases_that_differ_are_listed_against_another_label():
    truth = [true("payload", "flange")]
    mine = [result(truth, [effect("payload", "flange")]), result([], [], "nothing_left") | {"case": "clean-1"}]
    theirs = [result(truth, [effect("thermostat")]), result([], [], "nothing_left") | {"case": "clean-1"}]
    assert changes(mine, theirs, "base").row_count == 1
    assert changes(mine, mine, "base").row_count == 0


def test_the_reliability_diagram_has_intervals_of_the_binomial(tmp_path):
    low, high = wilson(np.array([0.9, 1.0]), np.array([10, 10]))
    assert low == pytest.approx([0.596, 0.722], abs=1e-3) and high == pytest.approx([0.982, 1.0], abs=1e-3)
    draw(reliability([result([], [effect("thermostat")])]), tmp_path / "r.png")
    assert (tmp_path / "r.png").read_bytes().startswith(b"\x89PNG")


def test_cases_without_signals_hide_no_effect_of_signals():
    assert not {name for case in cases(6, (10,)) for name in case.effects} & set(NEED_SIGNALS)
    names = {name for case in cases(7, (10,)) for name in case.effects}
    assert names == set(MECHANICAL | ELECTRICAL | OUTSIDE)
    assert not any("clock" in case.name for case in cases(7, (10,), own_clocks=True))


def test_the_same_seed_makes_the_same_files(tmp_path):
    world, case = World(6, 3, "short", torques=False, own_clocks=True), Case("payload-10", ("payload",), 10)
    truths = [make_after(world, case, tmp_path / name) for name in "ab"]
    assert truths[0] == truths[1] and truths[0]["effects"][0]["strength"] == pytest.approx(0.1, rel=0.03)
    assert (tmp_path / "a" / "power.csv").read_bytes() == (tmp_path / "b" / "power.csv").read_bytes()


@pytest.fixture
def fake_acqd(tmp_path):
    """A source tree whose acqd writes down its commands, fails where it should, and reports one effect."""
    package = tmp_path / "tree" / "acqd"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    script = """
import json, pathlib, sys
words = sys.argv[1:]
log = pathlib.Path(__file__).with_name("commands.jsonl")
log.open("a").write(json.dumps(words) + "\\n")
if "payload-1" in " ".join(words):
    sys.exit("no such luck")
out = pathlib.Path(words[words.index("--out") + 1])
out.mkdir(parents=True)
(out / "manifest.json").write_text(json.dumps({"recordings": [{"name": "cycle-ab", "lag_s": 0.002}]}))
print(json.dumps({"effects": [], "verdict": "nothing_left", "before": {"rmse": 1.0}, "after": {"rmse": 1.0},
                  "reference_rmse": 1.0, "thresholds": []}))
"""
    (package / "__main__.py").write_text(script)
    (package / "robot" / "descriptions").mkdir(parents=True)
    (package / "robot" / "descriptions" / "ur10e.toml").write_text("mass_deviation = 0.1  # the maker's\n")
    return tmp_path / "tree"


def commands(tree: Path) -> list[list[str]]:
    return [json.loads(line) for line in (tree / "acqd" / "commands.jsonl").read_text().splitlines()]


def test_cases_share_the_model_and_are_not_run_twice(fake_acqd, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PYTHONPATH", "/nowhere")
    words = ["foreign", str(tmp_path / "out"), "--robot", "6", "--amount", "short", "--acqd", str(fake_acqd)]
    words += ["--only", "clean-1", "--only", "payload-1", "--json"]
    monkeypatch.setattr(sys, "argv", words)
    study.main()
    printed = json.loads(capsys.readouterr().out)
    assert [row["outcome"] for row in printed["rows"]] == ["silent", "error"]
    assert printed["rows"][0]["lag_errors_s"] == {"cycle-ab": 0.002}
    assert "no such luck" in printed["rows"][1]["error"]
    steps = [" ".join(words[:2]) if words[0] == "dataset" else words[0] for words in commands(fake_acqd)]
    assert steps == ["dataset build", "train", "dataset build", "close-loop", "dataset build"]
    study.main()
    assert len(commands(fake_acqd)) == 5
    (tmp_path / "out" / "axes6-short-seed1" / "generator.sha256").write_text("another")
    with pytest.raises(SystemExit, match="1"):
        study.main()
    assert "another version of the generator" in capsys.readouterr().err.replace("\n", " ")
    assert runner.judged_tree(fake_acqd) == str(fake_acqd / "acqd")
