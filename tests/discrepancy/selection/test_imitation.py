"""A later effect must be more than an error of the earlier ones."""

from dataclasses import replace

from acqd.discrepancy.selection.imitation import beyond_earlier
from tests.discrepancy.independent import COMMON, INDEPENDENT, traced


def test_a_tenth_of_an_earlier_effect_may_be_its_error_and_a_third_is_not(model, robot):
    _, tracing = traced(model, robot, INDEPENDENT["coulomb_friction"], only=COMMON)
    named = tracing.effects[0]

    def share(size):
        return replace(named.finding, coefficients=size * named.finding.coefficients)

    assert beyond_earlier(tracing.design, [], share(0.1))
    assert not beyond_earlier(tracing.design, [named], share(0.1))
    assert not beyond_earlier(tracing.design, [named], share(-0.1))
    assert beyond_earlier(tracing.design, [named], share(0.3))
