"""What recordings could tell: sizes agree with the rules of the loop, pairs with correlations, more rows tell more."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.discrepancy import stand_ins
from acqd.discrepancy.ability.ability import Ability, table_of
from acqd.discrepancy.ability.pairs import rivals_of
from acqd.discrepancy.ability.smallest import smallest_sizes
from acqd.discrepancy.joints.witness import TwoWitnesses
from acqd.discrepancy.selection.judging import judged, kinds_of
from acqd.discrepancy.selection.ranking import Finding, ranked
from acqd.discrepancy.selection.spread import variances_of_sizes
from acqd.discrepancy.thresholds import THRESHOLDS
from tests.builders import recording
from tests.discrepancy.independent import COMMON, selected


@pytest.fixture(scope="module")
def rows(model, robot):
    """Unchanged recordings beside their reference."""
    before = [recording(model, k, rows=400, seed=1) for k in range(5)]
    after = [recording(model, k, rows=400, seed=2, start_s=1e9 + 5000) for k in range(5)]
    _, selection = selected(model, robot, after, before, COMMON)
    return selection.unexplained


@pytest.fixture(scope="module")
def seeing(rows, robot):
    """The same recordings with torques of joint sensors, of a small error."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stand_ins, "TORQUE_ERROR", 0.001)
        witness = stand_ins.with_torques(rows.design.columns, robot, "link")
    return replace(rows, design=replace(rows.design, witness=witness))


@pytest.fixture(scope="module")
def gate(rows):
    return rows.design.columns.in_question


@pytest.fixture(scope="module")
def sizes(rows, gate):
    return [each for each in smallest_sizes(rows, gate) if each.size is not None]


def with_size(rows, gate, place, size):
    """The finding of a candidate whose product with the residual is that of a size without noise."""
    (finding,) = ranked(rows, gate, [place.candidate])
    precision, prior = place.precision, finding.deviation[0] ** -2 - place.precision
    square = precision**2 * size**2 / (precision + prior)
    paid = np.log(1 + precision / max(prior, 1e-300)) + 2 * np.log(place.candidate.tried)
    both = witnesses(place, size)
    return replace(finding, coefficients=np.array([size]), evidence=square - paid, witnesses=both)


def witnesses(place, size):
    """Power and torques that say the same."""
    torques = place.from_torques * place.precision * size**2
    return TwoWitnesses(place.precision * size**2 - torques, torques) if torques else None


def test_an_estimate_of_the_smallest_size_passes_every_rule(rows, gate, sizes):
    kinds = kinds_of(rows.design.columns.candidates)
    assert len({each.candidate.id for each in sizes}) >= 6
    for place in sizes:
        finding = with_size(rows, gate, place, place.size)
        assert judged(rows, gate, finding, [], kinds).missing == (), place.candidate.label


def test_with_torques_the_rules_and_the_sizes_agree_and_sizes_are_smaller(seeing, gate, sizes):
    """What sessions differ by in power is no limit for what torques show: the sizes are those of the loop's rules."""
    kinds, without = kinds_of(seeing.design.columns.candidates), {each.candidate.key: each for each in sizes}
    shown = [each for each in smallest_sizes(seeing, gate) if each.from_torques > 0 and each.size is not None]
    assert {each.candidate.id for each in shown} == {"payload"}
    for place in shown:
        finding = with_size(seeing, gate, place, place.size)
        assert judged(seeing, gate, finding, [], kinds).missing == (), place.candidate.label
        smaller = 0.98 * (place.size - 1.645 * _error(seeing, gate, place))
        assert judged(seeing, gate, with_size(seeing, gate, place, smaller), [], kinds).missing != ()
    by_sessions = [e for e in shown if without[e.candidate.key].limited_by == "sessions"]
    assert by_sessions and all(each.size < 0.8 * without[each.candidate.key].size for each in by_sessions)
    for says in (-50.0, 50.0):  # torques without their power, of either sign
        contradicted = replace(finding, witnesses=replace(finding.witnesses, power_says=0.0, torques_say=says))
        assert "more than what unchanged" in str(judged(seeing, gate, contradicted, [], kinds).missing)


def test_an_estimate_below_the_size_by_its_error_fails_the_rule_that_limits(rows, gate, sizes):
    kinds = kinds_of(rows.design.columns.candidates)
    words = {"rows": "evidence above", "sessions": "more than what unchanged", "relevance": "a size that matters"}
    for place in sizes:
        low = place.size - 1.645 * _error(rows, gate, place)
        missing = judged(rows, gate, with_size(rows, gate, place, 0.98 * low), [], kinds).missing
        assert any(each.startswith(words[place.limited_by]) for each in missing), (place.candidate.label, missing)
        clear = judged(rows, gate, with_size(rows, gate, place, 1.02 * low), [], kinds).missing
        assert clear == (), place.candidate.label


def _error(rows, gate, place):
    unit = Finding(place.candidate, np.ones(1), np.zeros(1), 0.0, witnesses=witnesses(place, 1.0))
    ((variance, _),) = variances_of_sizes(rows.design, rows.regression, [unit], gate)
    return float(np.sqrt(1 / place.precision + variance))


def test_more_minutes_never_need_a_larger_effect(rows, gate, sizes):
    longer = {(e.candidate.key): e.size for e in smallest_sizes(rows, gate, 4.0)}
    assert all(longer[each.candidate.key] <= each.size * (1 + 1e-9) for each in sizes)
    assert any(longer[each.candidate.key] < 0.95 * each.size for each in sizes)


def test_an_effect_is_told_apart_the_later_the_more_a_rival_explains(rows, gate, sizes):
    for place, rivals in zip(sizes, rivals_of(rows, gate, sizes), strict=True):
        shares = [each.explains for each in rivals]
        assert shares == sorted(shares, reverse=True) and all(0 <= share <= 1 for share in shares)
        known = [each.size for each in rivals if each.size is not None]
        assert known == sorted(known, reverse=True) and min(known) >= place.size
        assert all((each.size is None) == (1 - each.explains <= THRESHOLDS.column_error**2) for each in rivals)


def test_a_rival_explains_the_squared_correlation_of_two_columns(rows, gate, sizes):
    """By a regression of one white column on the other, all else projected out."""
    by_name = {(each.candidate.id, each.candidate.label): each for each in sizes}
    one = by_name["coulomb_friction", "joint 2"]
    (rivals,) = rivals_of(rows, gate, [one])
    other = rivals[0]
    pool = [c for c in rows.design.columns.candidates if (c.id, c.label) == (other.id, other.where) and c.mix is None]
    both = np.concatenate([one.candidate.indices, pool[0].indices])
    schur = rows.regression.compete(both, gate).schur
    b = np.arange(1, len(both))
    share = schur[0, b] @ np.linalg.solve(schur[np.ix_(b, b)], schur[b, 0]) / schur[0, 0]
    assert other.explains == pytest.approx(share, rel=0.02)


def test_the_certificate_says_which_effects_no_size_is_stated_for(rows, gate):
    ability = Ability.of(rows, gate)
    said = ability.as_json()
    assert {each["id"] for each in said["not_judged"]} >= {"contact_force", "tool_actuation"} & set(COMMON)
    header, *table = table_of(ability)
    assert {row[0] for row in table} == set(ability.easiest) and all(len(row) == len(header) for row in table)
    for each in said["effects"]:
        assert (each["smallest"] is None) == (each["limited_by"] in ("bounds", "motion"))


def test_more_minutes_do_not_tell_a_load_from_the_level_of_the_session(rows, gate):
    """The level of a session differs by what sessions differ by, however long it lasts."""
    short, long = (
        {(e.candidate.id, e.candidate.label): e.precision for e in smallest_sizes(rows, gate, times)}
        for times in (1.0, 1e4)
    )
    level = next(c for c in rows.regression.columns if c.owner == "level of the session")
    assert long["offset_shift", "cabinet"] < 1.01 / level.deviation**2
    friction = ("coulomb_friction", "joint 2")  # the reference is known no better by more minutes of another day
    assert 2 * short[friction] < long[friction] < 4 * short[friction]
