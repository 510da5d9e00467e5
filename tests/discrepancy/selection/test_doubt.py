"""Doubts by unnamed alternatives: two causes together are no unknown cause, an unknown cause is."""

from dataclasses import replace

import numpy as np

from acqd.discrepancy.selection.accepted import Unknown
from acqd.discrepancy.selection.doubt import clear_doubts, doubted_steps, without_doubted
from tests.discrepancy.independent import COMMON, column, extra_power, traced

ONLY = COMMON | {"viscous_friction"}


def test_a_friction_and_a_load_that_a_curve_explains_together_are_both_named(model, robot):
    """A smooth function of a speed has a level too; each name alone explains clearly less."""

    def both(scene, random):
        return extra_power(scene, column(scene, 1, 6.0 * scene.qd[:, 1])) + 6.0

    _, tracing = traced(model, robot, both, count=7, only=ONLY)
    assert {named.id for named in tracing.effects} == {"viscous_friction", "offset_shift"}, tracing.hypotheses[:3]
    assert tracing.unknown is None and all(named.doubt is None for named in tracing.effects)


def test_a_friction_that_begins_above_a_speed_is_no_viscous_friction(model, robot):
    def fast_only(scene, random):
        speed = scene.qd[:, 1]
        return extra_power(scene, column(scene, 1, 25.0 * np.sign(speed) * np.maximum(np.abs(speed) - 0.25, 0.0)))

    _, tracing = traced(model, robot, fast_only, count=7, rows=700, only=ONLY)
    assert not tracing.effects and tracing.verdict == "unknown_structure"
    assert "joint 2" in tracing.unknown.finding.candidate.label
    best = max((each for each in tracing.hypotheses if each.id), key=lambda each: each.evidence)
    assert best.id == "viscous_friction"  # the hypotheses are those of the ranking in which the doubt arose


def test_a_friction_that_grows_with_another_joint_s_speed_is_described_as_such(model, robot):
    def coupled(scene, random):
        torque = 8.0 * np.tanh(scene.qd[:, 1] / 0.01) * np.abs(scene.qd[:, 0])
        return extra_power(scene, column(scene, 1, torque))

    _, tracing = traced(model, robot, coupled, count=7, rows=700, only=ONLY)
    assert tracing.verdict == "unknown_structure"
    assert tracing.unknown.finding.candidate.label in {
        "a friction of joint 2 that grows with the speed of joint 1",
        "a friction of joint 1 that grows with the speed of joint 2",  # the same mechanical power
    }


def test_effects_that_explain_together_what_the_alternative_explains_leave_the_doubt(model, robot):
    """Given the others, no friction of a set that imitates a curve is outdone by the curve."""

    def greased(scene, random):
        return extra_power(scene, column(scene, 1, 8.0 * scene.qd[:, 1]))

    _, tracing = traced(model, robot, greased, only=ONLY)
    (first,) = tracing.effects
    found = {(each.candidate.id, each.candidate.label): each for each in first.ranking}
    curve = found["", "a friction of joint 2 of another curve over its speed"]
    doubted = replace(first, doubt=Unknown(curve, first.gate))
    tracing.effects = [doubted]
    clear_doubts(tracing)
    assert tracing.effects[0].doubt is None
    second = replace(first, finding=found["coulomb_friction", "joint 2"])
    tracing.effects = [doubted, second]
    tracing.regression = tracing.regression.with_columns(tracing.design.blocks, second.columns())
    clear_doubts(tracing)
    assert tracing.effects[0].doubt is not None and doubted_steps(tracing) == 2
    assert without_doubted(tracing) and not tracing.effects and tracing.unknown.finding is curve
