"""The study of the tutorial's intervals counts what holds the truth."""

from tools.studies.tutorial import TRUTH, judged, tables


def effect(name="payload", mass=(1.5, [1.4, 1.6]), centre=(0.06, [0.05, 0.07])):
    sizes = {"mass": mass, "centre_of_mass_m": centre}
    return {"id": name, "where": "flange", "parameters": {k: {"value": v, "ci95": ci} for k, (v, ci) in sizes.items()}}


def test_intervals_are_compared_with_the_truth_of_the_laboratory():
    assert TRUTH == {"mass": 1.5, "centre_of_mass_m": 0.04}
    found = judged(2, {"verdict": "effects_found", "effects": [effect()]})
    assert found.holds("mass") is True and found.holds("centre_of_mass_m") is False
    other = judged(3, {"verdict": "effects_found", "effects": [effect("gravity_bias")]})
    silent = judged(4, {"verdict": "nothing_left", "effects": []})
    narrow = judged(5, {"verdict": "effects_found", "effects": [effect(centre=(0.04, None))]})
    assert other.holds("mass") is None and silent.named == "nothing_left" and narrow.holds("centre_of_mass_m") is None
    sums = tables([found, other, silent, narrow])[1]
    assert [list(column.cells) for column in sums.columns][:3] == [["mass", "centre_of_mass_m"], ["2", "1"], ["2", "0"]]
