"""The study of the certificate, on made-up results of the foreign study."""

from __future__ import annotations

import json
import sys

import pytest

from tools.studies.foreign import certificate as study


def place(name="payload", smallest=0.2, where="flange", unit="kg", shape=(), rivals=()):
    """Of a report's certificate."""
    told = [{"id": other, "where": where, "explains": 0.9, "told_apart_from": size} for other, size in rivals]
    return {"id": name, "where": where, "unit": unit, "smallest": smallest, "limited_by": "rows",
            "shape": dict(shape), "rivals": told}  # fmt: skip


def result(size, said, places, details=()):
    """A case with a hidden payload, and the names that the loop gives: (id, ids of its family)."""
    effects = [
        {"id": name, "where": "flange", "parameters": {}, "family": {"members": [{"id": other} for other in members]}}
        for name, members in said
    ]
    true = {"id": "payload", "where": "flange", "value": size, "unit": "kg", "size": size, "details": dict(details)}
    return {"world": "axes7-full-seed5", "case": "payload-3", "axes": 7, "truth": [true],
            "report": {"ability": {"effects": places}, "effects": effects}}  # fmt: skip


OTHERS = [place("copper_loss", where="joint 2", unit="W/Nm^2"), place("gravity_bias", where="link 7")]


def test_a_pair_counts_from_the_size_on_at_which_the_report_separates_it():
    places = [place(rivals=[("gravity_bias", 0.5)]), *OTHERS]
    small = study.stated(result(0.3, [("payload", [])], places))
    assert small.times == pytest.approx(1.5) and small.named
    assert small.separable == {"copper_loss": True} and small.close == ()
    large = study.stated(result(0.6, [("payload", ["gravity_bias"])], places))
    assert large.separable == {"copper_loss": True, "gravity_bias": False} and large.close == ("gravity_bias",)
    family = study.stated(result(0.6, [("payload", [])], [place(rivals=[("gravity_bias", None)]), *OTHERS]))
    assert set(family.separable) == {"copper_loss"}


def test_a_case_without_the_name_separates_nothing():
    case = study.stated(result(0.6, [], [place(), *OTHERS]))
    assert not case.named and not any(case.separable.values()) and len(case.separable) == 2


def test_the_size_is_that_of_the_true_place_in_the_closest_shape():
    places = [place(smallest=1.0, where="link 7"), place(shape={"minutes": 4.0}, smallest=0.1),
              place(shape={"minutes": 16.0}, smallest=0.3)]  # fmt: skip
    assert study.stated(result(0.6, [], places, {"minutes": 12.0})).times == pytest.approx(2.0)
    assert study.stated(result(0.6, [], places[:1])) is None


def test_the_command_prints_shares_and_what_breaks_the_promise(tmp_path, monkeypatch, capsys):
    results = tmp_path / "axes7-full-seed5" / "base" / "results"
    results.mkdir(parents=True)
    (results / "named.json").write_text(json.dumps(result(0.5, [("payload", [])], [place()])))
    (results / "missed.json").write_text(json.dumps(result(0.6, [], [place()])))
    (results / "silent.json").write_text(json.dumps(result(0.05, [], [place()])))
    monkeypatch.setattr(sys, "argv", ["certificate", str(tmp_path)])
    study.main()
    printed = capsys.readouterr().out
    assert "1 of 2" in printed and "0 of 1" in printed and "3.0 times, not named" in printed
