"""Every rule between evidence and a name, on made-up findings: each test fails without its rule."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.selection import spread
from acqd.discrepancy.selection.judging import USUAL, judged, kinds_of, left_by, margin
from acqd.discrepancy.selection.placing import without
from acqd.discrepancy.selection.ranking import ranked
from acqd.discrepancy.selection.spread import learning_rate
from acqd.discrepancy.thresholds import THRESHOLDS
from tests.builders import recording
from tests.discrepancy.independent import COMMON, added_payload, column, extra_power, selected, since_release

KINDS = 40
CHANCE = 2 * np.log(KINDS / 0.02)


def dry(nm):
    """Dry friction of joint 2."""
    return lambda scene, random: extra_power(scene, column(scene, 1, nm * np.tanh(scene.qd[:, 1] / 0.004)))


@pytest.fixture(scope="module")
def friction(model, robot):
    """Rows with a friction of 8 Nm that competes again, its gate, and the finding with columns over both sides."""
    before = [recording(model, k, rows=400, seed=1) for k in range(5)]
    after = [recording(model, k, dry(8.0), rows=400, seed=2, start_s=1e9 + 5000) for k in range(5)]
    _, selection = selected(model, robot, after, before, COMMON)
    (effect,) = selection.effects
    rows, gate = without(selection.rows, effect), effect.gate.open
    pool = [c for c in rows.design.columns.candidates if (c.id, c.label) == ("coulomb_friction", "joint 2")]
    return rows, gate, ranked(rows, gate, pool)[0]


def missing(friction, **changes):
    rows, gate, finding = friction
    return judged(rows, gate, replace(finding, **changes), [], KINDS).missing


def test_a_clear_change_of_a_size_that_matters_lacks_nothing(friction):
    assert missing(friction) == ()


def test_evidence_counts_above_what_the_best_of_many_hypotheses_has_by_chance(friction):
    assert missing(friction, evidence=CHANCE + 0.1) == ()
    assert missing(friction, evidence=CHANCE - 0.1) == (f"evidence above {CHANCE:.0f}",)


def test_a_size_that_nobody_would_act_on_is_no_finding(friction):
    rows, gate, finding = friction
    small = replace(finding, coefficients=0.01 * finding.coefficients)
    assert any(each.startswith("a size that matters") for each in judged(rows, gate, small, [], KINDS).missing)


def test_what_rests_on_sizes_that_physics_forbids_is_no_finding(friction):
    """Chance and wrong columns ask for some of it: a loss of an idle joint is at its bound in half of all fits."""
    _, _, finding = friction
    most = CHANCE + THRESHOLDS.column_error**2 * finding.evidence
    assert missing(friction, forbidden=most - 1) == ()
    assert missing(friction, forbidden=most + 1) == ("a size within its physical bounds",)


def test_what_unchanged_sessions_differ_by_is_no_change(model, robot):
    """The friction of the reference's logs varies by as much as the change in question."""
    before = [recording(model, k, dry(8.0 * (-1) ** k), rows=400, seed=1) for k in range(6)]
    after = [recording(model, k, dry(8.0), rows=400, seed=2, start_s=1e9 + 5000) for k in range(5)]
    _, selection = selected(model, robot, after, before, COMMON)
    assert not selection.effects
    assert selection.usual
    assert all(each.missing == (USUAL,) and "joint 2" in each.where for each in selection.usual)


@pytest.mark.slow
def test_an_effect_is_named_beside_what_unchanged_sessions_differ_by(model, robot):
    """The friction explains more than the payload, and is no change."""
    before = [recording(model, k, dry(8.0 * (-1) ** k), rows=400, seed=1) for k in range(6)]

    def both(scene, random):
        return dry(8.0)(scene, random) + added_payload(scene, random)

    after = [recording(model, k, both, rows=400, seed=2, start_s=1e9 + 5000) for k in range(5)]
    _, selection = selected(model, robot, after, before, {"coulomb_friction", "payload"})
    assert selection.usual and all("joint 2" in each.where for each in selection.usual)
    (payload,) = selection.effects
    assert payload.id == "payload" and payload.finding.coefficients[0] == pytest.approx(2.0, abs=0.4)


def test_columns_that_are_wrong_leave_a_share_of_what_a_known_effect_explains(friction):
    rows, gate, finding = friction
    large = replace(finding, evidence=1e5)
    whole = margin(rows, gate, finding, [large], KINDS)
    assert whole == pytest.approx(CHANCE + THRESHOLDS.column_error**2 * 1e5, rel=1e-6)
    assert judged(rows, gate, replace(finding, evidence=whole - 1), [large], KINDS).missing
    assert not judged(rows, gate, replace(finding, evidence=whole + 1), [large], KINDS).missing


def test_an_effect_at_other_times_inherits_nothing_from_a_known_one(friction):
    """Dry friction acts while the joint moves, the surge of the brakes while the arm rests."""
    rows, gate, finding = friction
    surge = [
        (25.0 * (since_release(scene) >= 0) * np.exp(-np.maximum(since_release(scene), 0) / 0.15))[::10][: scene.rows]
        for scene in rows.design.columns.scenes
    ]
    residuals = rows.design.columns.residual
    surges = [np.resize(each, len(own))[:, None] for each, own in zip(surge, residuals, strict=True)]
    design, indices = rows.design.with_columns(surges)
    large = replace(finding, evidence=1e5)
    known = replace(large, candidate=replace(finding.candidate, indices=indices, variant=None))
    assert left_by(design, gate, finding, [known]) < 0.3 * left_by(design, gate, finding, [large])


@pytest.mark.slow
def test_rows_of_a_reference_that_surprises_itself_count_less(model, robot):
    rates = {}
    for wobble in (0.0, 3.0):
        before = [recording(model, k, dry(wobble * (-1) ** k), rows=400, seed=1) for k in range(6)]
        after = [recording(model, k, rows=400, seed=2, start_s=1e9 + 5000) for k in range(4)]
        _, selection = selected(model, robot, after, before, COMMON)
        rates[wobble] = selection.rows.learning_rate
    assert rates[3.0] < 0.7 * rates[0.0] <= 0.7
    alone = learning_rate(selection.design, selection.regression)
    assert alone == pytest.approx(rates[3.0])


def test_kinds_are_effects_and_laws_and_not_their_places(friction):
    rows, _, _ = friction
    candidates = rows.design.columns.candidates
    assert kinds_of(candidates) == len({each.kind for each in candidates}) < len(candidates) / 4
    counts = {each.kind: each.tried for each in candidates}
    assert counts["coulomb_friction"] == sum(1 for each in candidates if each.kind == "coulomb_friction")


def test_a_long_log_is_as_many_sessions_as_it_is_longer_than_those_of_the_reference():
    amplitudes, information = np.array([0.3, -0.3, 0.3, -0.3]), np.ones(4)

    def variance(rows_per_log):
        logs = [("a", False, 200)] * 4 + [(f"log{k}", True, rows) for k, rows in enumerate(rows_per_log)]
        parts = [
            SimpleNamespace(recording=f"{name}{k}", in_question=now, segment=0) for k, (name, now, _) in enumerate(logs)
        ]
        now = np.array([1.0 * each for _, each, _ in logs])
        blocks = SimpleNamespace(rows=np.array([float(rows) for *_, rows in logs]))
        design = SimpleNamespace(
            parts=parts, blocks=blocks, columns=SimpleNamespace(in_question=now, segments=[SimpleNamespace(session="")])
        )
        return spread.variance_of(design, amplitudes, information, 0.1, now)

    assert variance([800]) == pytest.approx(variance([200] * 4))
    assert variance([200]) == pytest.approx(variance([50]))
    assert variance([800]) < 0.7 * variance([200])


def test_sessions_of_several_days_differ_by_less_than_those_of_one():
    amplitudes, information = np.array([0.3, -0.3, 0.3, -0.3]), np.ones(4)

    def variance(sessions):
        parts = [SimpleNamespace(recording=f"a{k}", in_question=False, segment=0) for k in range(4)]
        parts += [SimpleNamespace(recording=f"b{k}", in_question=True, segment=k) for k in range(len(sessions))]
        now = np.array([1.0 * part.in_question for part in parts])
        columns = SimpleNamespace(in_question=now, segments=[SimpleNamespace(session=name) for name in sessions])
        design = SimpleNamespace(parts=parts, blocks=SimpleNamespace(rows=np.full(len(parts), 200.0)), columns=columns)
        return spread.variance_of(design, amplitudes, information, 0.1, now)

    assert variance(["", "next"]) < 0.75 * variance(["", ""])
