"""The change of a seed, what the loop says about it, and the page."""

import numpy as np
import pytest

from acqd.lab.cell import build_cell
from acqd.lab.settings import LabSettings
from acqd.lab.trial.hidden import CHANGES, Hidden, drawn
from acqd.lab.trial.outcome import Size, outcome
from acqd.lab.trial.page import Trial, trial_page
from acqd.lab.trial.picture import Sessions
from acqd.report import KeyFigure, Page, Verdict
from tests.report.charts import chart

BY_ID = {change.id: change for change in CHANGES}
SURE = {"confidence": 0.97, "rivals": [], "family": {"members": []}}


def effect(name, where, rivals=(), kin=(), **parameters):
    sizes = {
        key.replace("_", " "): {"value": value, "unit": unit, "ci95": ci95}
        for key, (value, unit, ci95) in parameters.items()
    }
    more = {"rivals": [{"id": each} for each in rivals], "family": {"members": [{"id": each} for each in kin]}}
    return SURE | {"id": name, "where": where, "parameters": sizes} | more


def told(*effects, verdict="effects_found"):
    return {"verdict": verdict, "effects": list(effects)}


def test_a_seed_draws_one_change_that_the_laboratory_can_make():
    changes = [drawn(seed) for seed in range(1, 121)]
    assert {hidden.change.id for hidden in changes} == set(BY_ID) and drawn(7) == drawn(7)
    for hidden in changes:
        assert hidden.change.smallest * 0.95 <= hidden.size <= hidden.change.largest * 1.05
        assert bool(hidden.axis) == bool(hidden.change.axes)
    kinds = {hidden.change.id: hidden.effect for hidden in changes}
    build_cell(LabSettings(effects=list(kinds.values())))  # every axis exists


@pytest.mark.parametrize(
    ("hidden", "report", "answer"),
    [
        (Hidden(BY_ID["payload"], 1.5, 0), told(effect("payload", "flange")), "right"),
        (Hidden(BY_ID["payload"], 1.5, 0), told(effect("payload", "flange, beside its axis")), "right"),
        (Hidden(BY_ID["payload"], 1.5, 0), told(effect("gravity_bias", "link 7", ["payload"])), "rival"),
        (Hidden(BY_ID["payload"], 1.5, 0), told(effect("gravity_bias", "link 7", kin=["payload"])), "rival"),
        (Hidden(BY_ID["payload"], 1.5, 0), told(effect("copper_loss", "joint 2")), "wrong"),
        (Hidden(BY_ID["payload"], 1.5, 0), told(verdict="nothing_left"), "nothing"),
        (Hidden(BY_ID["payload"], 1.5, 0), told(verdict="not_identifiable"), "open"),
        (Hidden(BY_ID["coulomb_friction"], 0.5, 1), told(effect("coulomb_friction", "joint 1")), "right"),
        (Hidden(BY_ID["coulomb_friction"], 0.5, 1), told(effect("coulomb_friction", "joint 10")), "place"),
        (Hidden(BY_ID["gravity_bias"], 1.5, 4), told(effect("gravity_bias", "link 4, weight only")), "right"),
        (
            Hidden(BY_ID["coulomb_friction"], 0.5, 2),
            told(effect("coulomb_friction", "each joint", torque_joint_1=(1, "Nm", [-1, 3]),
                        torque_joint_2=(4, "Nm", [3, 5]))),
            "right",
        ),
        (
            Hidden(BY_ID["coulomb_friction"], 0.5, 1),
            told(effect("coulomb_friction", "each joint", torque_joint_1=(1, "Nm", [-1, 3]),
                        torque_joint_2=(4, "Nm", [3, 5]))),
            "place",
        ),
    ],
)  # fmt: skip
def test_what_the_loop_says_is_compared_with_the_truth(hidden, report, answer):
    assert outcome(hidden, report).answer == answer


def test_a_size_is_compared_where_the_loop_gives_the_same_quantity():
    mass = effect("payload", "flange", mass=(1.45, "kg", [1.4, 1.49]))
    found = outcome(Hidden(BY_ID["payload"], 1.5, 0), told(mass))
    assert found.size == Size(1.45, "kg", (1.4, 1.49)) and found.size.holds(1.5) is False
    assert Size(1.45, "kg", None).holds(1.5) is None
    torque = effect("coulomb_friction", "joint 1", torque=(2.0, "Nm", [1, 3]))
    assert outcome(Hidden(BY_ID["coulomb_friction"], 0.5, 1), told(torque)).size is None


def test_the_true_power_is_that_of_the_session_at_the_time(tmp_path):
    for number, start_s in ((1, 100.0), (2, 500.0)):
        clean = np.full(50, 200.0)
        np.savez(
            tmp_path / f"s{number}.npz",
            start_utc_ns=np.int64(start_s * 1e9), window_s=0.04, P_W=clean + number, P_without_effects_W=clean,
        )  # fmt: skip
    added = Sessions.of(tmp_path).at(np.array([0.0, 100.5, 300.0, 501.0]))
    np.testing.assert_allclose(added, [0, 1, 0, 2])


def test_the_page_has_the_verdict_first_and_the_truth_after_it(tmp_path):
    loop = tmp_path / "loop" / "report.html"
    loop.parent.mkdir()
    closing = Page("Error of the model", simulated=True, kind="closing report")
    closing.verdict(Verdict("found", "Cause found: payload (flange)", "", [KeyFigure("mass", "1.45 kg")], ["weigh"]))
    closing.write(loop)
    hidden = Hidden(BY_ID["payload"], 1.5, 0)
    found = outcome(hidden, told(effect("payload", "flange", mass=(1.45, "kg", [1.4, 1.49]))))
    steps, pages = [("acqd train <ds>", 7.2), ("acqd close-loop ds", None)], [loop, tmp_path / "gone.html"]
    trial = Trial(tmp_path, "iiwa7_r800", 3, hidden, found, steps, pages, ["acqd next loop"])
    body = trial_page(trial, chart()).html().partition("<body>")[2].replace("\N{NO-BREAK SPACE}", " ")
    order = [
        "simulated data", "Cause found: payload (flange)", "1.45 kg", "What was hidden", "a mass hangs at the flange",
        "The loop has named the hidden change", "1.40 to 1.49 kg", ">no</td>", "acqd train &lt;ds&gt;",
        'href="loop/report.html"', "acqd next loop",
    ]  # fmt: skip
    places = [body.index(part) for part in order if part in body]
    assert [part for part in order if part not in body] == [] and places == sorted(places)
    assert "gone.html" not in body
