"""Which cause a motion tells from which, on made-up columns."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.least_squares import Moments
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.experiment.choice import after, chosen, d_optimal, dealt, filled
from acqd.experiment.contest import Cause, Contest, together

CAUSE = Candidate("payload", "flange", np.array([0]), key="payload 0")
RIVAL = Candidate("gravity_bias", "link 6", np.array([1]), key="gravity_bias 0")
OTHER_PLACE = Candidate("payload", "beside the axis", np.array([2]), key="payload 1")
BASE = np.array([[50.0]])


def cause(size=1.0, deviation=1e-6, between=0.0):
    spreads = (between, 10.0), (between / 2, 10.0)
    return Cause(CAUSE, np.ones(1), size, deviation, (-10.0, 10.0), np.ones(1), 50.0, 1.0, *spreads)


def contest(rivals=(RIVAL,), learning_rate=1.0, **more):
    priors = [np.full(len(rival.indices), 10.0) for rival in rivals]
    return Contest.of((cause(**more),), rivals, priors, np.array([1e-6]), learning_rate, 20, 8)


def moments(rows, alike, used):
    """Of `rows` with unit columns, whose cosine with the first is `alike`; base column apart."""
    squares = rows * np.where(np.eye(used, dtype=bool), 1.0, alike)
    return Moments(rows * BASE, np.zeros((1, used)), squares)


def probability(compared, of):
    return float(compared.probabilities(of)[0])


def test_more_rows_make_a_name_likelier_up_to_what_the_loop_can_say():
    values = [probability(contest(), moments(rows, 0.5, 2)) for rows in (1, 20, 60, 20_000)]
    most = 1 - THRESHOLDS.chance
    assert values == sorted(values) and values[0] < 0.01 and 0.999 * most < values[-1] <= most


def test_a_rival_that_looks_alike_keeps_a_name_from_being_likely():
    apart, alike = (probability(contest(), moments(100, share, 2)) for share in (0.3, 0.995))
    assert apart > 0.95
    assert alike < 0.01
    assert contest().closest(moments(100, 0.995, 2)) == ["gravity_bias (link 6)"]


def test_no_number_of_rows_tells_columns_apart_that_differ_by_less_than_their_error():
    assert probability(contest(), moments(1e6, 0.995, 2)) < 0.01


def test_another_place_of_the_same_effect_is_no_rival():
    assert probability(contest(rivals=(OTHER_PLACE,)), moments(100, 0.999, 2)) > 0.95


def test_sizes_that_unchanged_sessions_differ_by_are_not_named():
    assert probability(contest(between=1.0), moments(2000, 0.3, 2)) < 0.1


def test_another_session_halves_what_days_differ_by():
    one = contest(between=0.1)
    two = replace(one, another=True)
    assert probability(one, moments(2000, 0.3, 2)) + 0.2 < probability(two, moments(2000, 0.3, 2))


def test_a_rival_with_many_parameters_pays_for_them():
    many = Candidate("", "a curve", np.arange(1, 9), key="a curve")
    one = contest()
    several = contest(rivals=(many,))
    squares = 60 * np.eye(9)
    squares[0, 1] = squares[1, 0] = 60 * 0.85
    costly = Moments(60 * BASE, np.zeros((1, 9)), squares)
    cheap = Moments(60 * BASE, np.zeros((1, 2)), squares[:2, :2])
    assert probability(several, costly) > probability(one, cheap)


def test_what_the_model_explains_already_counts_for_nothing():
    hidden = Moments(100 * np.eye(1), np.full((1, 2), 100.0), 100 * np.ones((2, 2)))
    assert probability(contest(), hidden) < 1e-6


def test_pieces_beside_the_shortlist_are_looked_at_before_the_choice_ends():
    def of(first, second):
        return Moments(np.diag([first, second]), np.zeros((2, 1)), np.zeros((1, 1)))

    pieces = {f"alike {k}": of(5.0, 0.0) for k in range(20)} | {"other": of(0.0, 1.0)}
    program = chosen(
        lambda known: np.minimum(np.diag(known.normal), [5.0, 1.0]).sum(), of(0.0, 0.0), pieces,
        dict.fromkeys(pieces, 1.0), 10.0, 1.0,
    )  # fmt: skip
    assert sorted(program) == ["alike 0", "other"]


@pytest.mark.parametrize("share", [0.5, 0.05])
def test_rows_count_with_the_learning_rate(share):
    full = probability(contest(), moments(100 * share, 0.5, 2))
    assert probability(contest(learning_rate=share), moments(100, 0.5, 2)) == pytest.approx(full, rel=0.05, abs=0.02)


def test_the_program_prefers_motion_in_which_the_causes_differ():
    compared = contest()
    pieces = {"alike": moments(20, 0.999, 2), "apart": moments(20, 0.2, 2), "idle": moments(1e-9, 0.0, 2)}
    seconds = {"alike": 10.0, "apart": 10.0, "idle": 10.0}
    program = chosen(compared.score, moments(5, 0.99, 2), pieces, seconds, 35.0, 1.0)
    assert program == ["apart"] * 3


def test_a_program_keeps_its_time_and_uses_short_pieces_for_the_rest():
    pieces = {"long": moments(40, 0.2, 2), "short": moments(0.5, 0.2, 2)}
    program = chosen(contest().score, moments(9, 0.5, 2), pieces, {"long": 30.0, "short": 5.0}, 41.0, 1.0)
    assert sorted(program) == ["long", "short", "short"]
    assert filled(["long", "short"], {"long": 30.0, "short": 5.0}, 41.0) == ["long", "short", "short"]


def test_identification_asks_for_other_motion_than_discrimination():
    compared = contest()
    excites = Moments(5000 * BASE, np.zeros((1, 2)), moments(1, 0.999, 2).squares)
    pieces = {"excites": excites, "apart": moments(20, 0.2, 2)}
    seconds = {"excites": 10.0, "apart": 10.0}
    assert chosen(d_optimal(compared), moments(1, 0.9, 2), pieces, seconds, 10.0, 1.0) == ["excites"]
    assert chosen(compared.score, moments(1, 0.9, 2), pieces, seconds, 10.0, 1.0) == ["apart"]


@pytest.mark.parametrize(("learning_rate", "pieces_told"), [(1.0, 4.0), (0.5, 1.6)])
def test_a_repeated_piece_repeats_the_errors_of_the_model(learning_rate, pieces_told):
    nothing, piece = moments(0, 0.5, 2), moments(10, 0.5, 2)
    again = after(nothing, {"turn": piece}, ["turn"] * 4, learning_rate)
    assert np.allclose(again.squares, pieces_told * piece.squares)
    apart = after(nothing, {str(k): piece for k in range(4)}, list("0123"), learning_rate)
    assert np.allclose(apart.normal, 4 * piece.normal)


def test_a_program_has_different_pieces_where_the_model_is_wrong():
    pieces = {name: moments(20, 0.2, 2) for name in ("turn", "other turn")} | {"idle": moments(0.1, 0.2, 2)}
    seconds = dict.fromkeys(pieces, 10.0)
    program = chosen(contest(learning_rate=0.5).score, moments(5, 0.99, 2), pieces, seconds, 40.0, 0.5)
    assert sorted(program) == ["other turn", "other turn", "turn", "turn"]


def test_a_cause_that_no_motion_tells_does_not_choose_the_motion_for_the_others():
    """The rival explains all but a trace of the second cause in any motion, most of it in the slow one."""
    hidden = replace(cause(), candidate=replace(CAUSE, indices=np.array([2]), id="friction", key="friction"))
    twin = replace(RIVAL, indices=np.array([3]), id="twin", key="twin")
    both = Contest.of(
        tuple(replace(each, believed=0.5) for each in (cause(), hidden)), (RIVAL, twin), [np.full(1, 10.0)] * 2,
        np.array([1e-6]), 1.0, 20, 8,
    )  # fmt: skip

    def piece(rows, of_hidden, alike):
        squares = np.zeros((4, 4))
        squares[:2, :2] = rows * np.array([[1.0, 0.5], [0.5, 1.0]])
        squares[2:, 2:] = of_hidden * np.array([[1.0, alike], [alike, 1.0]])
        return Moments(50 * np.eye(1), np.zeros((1, 4)), squares)

    so_far, pieces = piece(20, 4000, 0.9999), {"fast": piece(20, 1, 0.9999), "slow": piece(0.1, 4000, 0.995)}
    assert both.probabilities(so_far)[1] < 1e-6
    assert chosen(both.score, so_far, pieces, dict.fromkeys(pieces, 10.0), 10.0, 1.0) == ["fast"]


def test_moments_of_independent_blocks_add():
    both = together([moments(10, 0.5, 2), moments(30, 0.5, 2)])
    assert np.allclose(both.squares, moments(40, 0.5, 2).squares) and np.allclose(both.normal, 40 * BASE)


def test_uncertain_sizes_make_a_name_less_certain():
    sure, unsure = contest(size=1.0), contest(size=1.0, deviation=0.5)
    at = moments(150, 0.3, 2)
    assert probability(unsure, at) < probability(sure, at)
    assert replace(unsure.causes[0], deviation=0.0).sizes()[0] == pytest.approx(np.ones(7))


def test_a_law_takes_the_place_of_a_name_only_where_the_law_is_ahead_by_the_margin():
    law = replace(RIVAL, id="", label="a friction of another curve")
    alike = moments(100, 0.9999, 2)
    assert probability(contest(), alike) < 0.01  # an effect that looks alike
    assert probability(contest(rivals=(law,)), alike) > 0.95
    unnamed = replace(contest().causes[0], candidate=replace(CAUSE, id="", label="another law"))
    among_laws = Contest.of((unnamed,), (law,), [np.full(1, 10.0)], np.array([1e-6]), 1.0, 20, 8)
    assert probability(among_laws, alike) < 0.01  # nothing is preferred


def test_the_closest_rival_is_the_one_that_is_said_most_easily():
    law = replace(RIVAL, id="", label="a friction of another curve", key="law")
    effect = replace(RIVAL, indices=np.array([2]), key="effect")
    squares = 100 * np.array([[1.0, 0.999, 0.9], [0.999, 1.0, 0.9], [0.9, 0.9, 1.0]])
    both = contest(rivals=(law, effect))
    assert both.closest(Moments(100 * BASE, np.zeros((1, 3)), squares)) == ["gravity_bias (link 6)"]


def test_recordings_that_left_a_question_are_not_expected_to_answer_it():
    so_far, after_it = moments(30, 0.5, 2), moments(60, 0.5, 2)
    behind, level, ahead = (
        contest().since(so_far, {RIVAL.key: 50.0 - lead}) for lead in (-15.0, 30 * 0.75, 40.0)
    )  # fmt: skip
    values = [probability(each, after_it) for each in (behind, level, ahead)]
    assert values[0] < 0.3 and values[0] + 0.2 < values[1] < values[2]
    assert values[1] == pytest.approx(probability(contest(), after_it), abs=0.02)  # the lead is the expected one


def test_what_sessions_differ_by_makes_the_lead_over_a_rival_uncertain():
    """By an effect that its size alone would name."""
    differs = replace(contest(), causes=(replace(cause(), between_sessions=(0.12**2, 1000.0)),))
    at = moments(400, 0.94, 2)
    assert probability(replace(differs, rivals=(OTHER_PLACE,), same_kind=~differs.same_kind), at) > 0.97
    assert 0.6 < probability(differs, at) < probability(contest(), at) - 0.01


def test_held_out_recordings_have_to_show_a_cause_and_a_law_beyond_chance():
    law = replace(cause(), candidate=replace(CAUSE, id="", label="a law"))
    at = Moments(26 * BASE, np.zeros((1, 1)), 26 * np.ones((1, 1)))
    named, unnamed = (
        probability(Contest.of((own,), (), [], np.array([1e-6]), 1.0, 20, 8), at) for own in (cause(), law)
    )  # fmt: skip
    assert unnamed + 0.1 < named < 0.9 * (1 - THRESHOLDS.chance)  # a third of 26, and more scatter


@pytest.mark.parametrize("parts", [1, 4])
def test_each_recording_of_a_program_has_some_of_the_best_pieces(parts):
    program = [f"piece {k}" for k in range(12)]
    seconds = {name: 5.0 + k % 3 for k, name in enumerate(program)}
    order = dealt(program, seconds, parts)
    assert sorted(order) == sorted(program)
    ends = np.cumsum([seconds[name] for name in order])
    part_of = {
        name: min(int((end - 1e-6) / (ends[-1] / parts)), parts - 1) for name, end in zip(order, ends, strict=True)
    }
    assert {part_of[name] for name in program[:parts]} == set(range(parts))
