"""Families get the name of the member that most recordings prefer."""

from copy import deepcopy
from dataclasses import replace

import pytest

from acqd.discrepancy.selection.family import family, likeliest_member
from tests.discrepancy.independent import COMMON, column, extra_power, traced


@pytest.fixture(scope="module")
def greased(model, robot):
    """The selection on recordings with a higher viscous friction of joint 2, next to that of cold gears."""

    def friction(scene, random):
        return extra_power(scene, column(scene, 1, 8.0 * scene.qd[:, 1]))

    return traced(model, robot, friction, only=COMMON | {"viscous_friction", "thermal_friction"})[1]


@pytest.mark.xdist_group("greased")
def test_a_name_that_most_recordings_prefer_stays(greased):
    tracing = deepcopy(greased)
    (named,) = tracing.effects
    assert named.id == "viscous_friction"
    assert likeliest_member(tracing, named, 1) is named


@pytest.mark.xdist_group("greased")
def test_the_likelier_member_takes_the_place_of_the_name(greased):
    tracing = deepcopy(greased)
    (named,) = tracing.effects
    cold = next(each for each in named.alternatives if each.candidate.id == "thermal_friction")
    others = [each for each in named.alternatives if each.candidate.id != "thermal_friction"]
    scanned = next(each for each in named.ranking if each.candidate.key == named.key)
    wrong = replace(named, finding=replace(cold, support=named.finding.support), alternatives=[scanned, *others])
    regression = tracing.regression.without(named.key)
    tracing.effects, tracing.regression = [wrong], regression.with_columns(tracing.design.blocks, wrong.columns())
    assert "viscous_friction" in {each.candidate.id for each in family(tracing, wrong)}
    right = likeliest_member(tracing, wrong, 1)
    assert (right.id, right.place.where) == ("viscous_friction", named.place.where)
    assert right.finding.coefficients[0] == pytest.approx(named.finding.coefficients[0], rel=0.02)
    assert "thermal_friction" in {each.candidate.id for each in right.alternatives}
