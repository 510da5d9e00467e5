"""Gram matrices and projections against direct least squares; a frozen design."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.discrepancy.regression.gram import Blocks, Gram, upper_triangle
from acqd.discrepancy.regression.least_squares import Column, Regression
from acqd.discrepancy.regression.setup import Comparison, set_up
from tests.builders import recording

BLOCKS, ROWS, FIXED = 3, 40, 4


def gram_of(whole):
    """Of the products [blocks, columns, columns] of all columns; those behind the residual are added ones."""
    gram = Gram.of(FIXED, tuple(upper_triangle(each[: FIXED + 1, : FIXED + 1]) for each in whole))
    added = np.arange(FIXED + 1, whole.shape[1])
    return gram.replaced(added, list(whole[:, :, added])) if len(added) else gram


def blocks(random, added):
    """Blocks of random rows with `added` columns behind the residual, and the rows themselves."""
    rows = random.normal(size=(BLOCKS, ROWS, FIXED + 1 + added))
    whole = np.einsum("bri,brj->bij", rows, rows)
    gram = gram_of(whole)
    return Blocks(gram, np.zeros((BLOCKS, gram.size)), np.full(BLOCKS, float(ROWS))), rows, whole


@given(seed=st.integers(0, 2**32 - 1), added=st.integers(0, 3), data=st.data())
@settings(deadline=None, max_examples=60)
def test_any_part_of_the_gram_matrix_can_be_taken(seed, added, data):
    b, _, whole = blocks(np.random.default_rng(seed), added)
    index = st.lists(st.integers(0, FIXED + added), min_size=1, max_size=5)
    rows, columns = np.array(data.draw(index)), np.array(data.draw(index))
    block = data.draw(st.integers(0, BLOCKS - 1))
    np.testing.assert_array_equal(b.white.take(block, rows, columns), whole[block][np.ix_(rows, columns)])
    several = np.array([0, 2])
    np.testing.assert_array_equal(b.white.take(several, rows, columns), whole[np.ix_(several, rows, columns)])


@given(seed=st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=30)
def test_replaced_columns_have_the_products_of_their_values(seed):
    random = np.random.default_rng(seed)
    b, rows, _ = blocks(random, 1)
    values = random.normal(size=(BLOCKS, ROWS, 2))  # column 5 is replaced, column 6 is new
    changed = np.concatenate([rows[:, :, :5], values], axis=2)
    products = list(np.einsum("bri,brj->bij", changed, values))
    gram = b.white.replaced(np.array([5, 6]), products)
    everything = np.arange(7)
    expected = np.einsum("bri,brj->bij", changed, changed)
    np.testing.assert_allclose(gram.take(slice(None), everything, everything), expected, atol=1e-9)
    assert b.white.size == 6  # the old one is what it was


@given(seed=st.integers(0, 2**32 - 1), out=st.integers(0, BLOCKS - 1))
@settings(deadline=None, max_examples=30)
def test_a_fit_without_a_block_knows_nothing_of_that_block(seed, out):
    """Also where a column acts in that block only: the block is taken away from the sum of all."""
    random = np.random.default_rng(seed)
    _, rows, _ = blocks(random, 0)
    rows[np.arange(BLOCKS) != out, :, 1] = 0.0
    rows[out] *= 30.0
    whole = np.einsum("bri,brj->bij", rows, rows)

    def regression(kept):
        gram = gram_of(whole[list(kept)])
        columns = [Column(0, np.ones(len(kept))), Column(1, np.ones(len(kept)), 10.0)]
        return Regression(Blocks(gram, np.zeros((BLOCKS, gram.size)), np.full(len(kept), float(ROWS))), columns)

    others = [k for k in range(BLOCKS) if k != out]
    candidates, weights = np.array([2, 3]), np.ones(BLOCKS)
    weights[out] = 0.0
    without = regression(range(BLOCKS)).compete(candidates, np.ones(BLOCKS), weights)
    direct = regression(others).compete(candidates, np.ones(len(others)))
    np.testing.assert_allclose(without.schur, direct.schur, rtol=1e-6)
    np.testing.assert_allclose(without.products, direct.products, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(without.beta, direct.beta, rtol=1e-6, atol=1e-6)


@given(seed=st.integers(0, 2**32 - 1), data=st.data())
@settings(deadline=None, max_examples=40)
def test_products_of_a_smaller_or_larger_regression_are_those_of_all_its_columns(seed, data):
    """Whatever columns came and went, on designs with other values of columns that the regression has not."""
    random = np.random.default_rng(seed)
    b, rows, _ = blocks(random, 2)

    def column(index, owner):
        return Column(index, random.integers(0, 2, BLOCKS) * 1.0, owner=owner, varies=random.choice(["", "a", "b"]))

    everywhere = np.ones(BLOCKS)
    regression = Regression(b, [Column(0, everywhere), column(1, "")])
    for what in data.draw(st.lists(st.sampled_from(["solve", "more", "less", "replace", "trust"]), max_size=12)):
        if what == "solve":
            regression.normal(everywhere)
        elif what == "more":
            regression = regression.with_columns(b, [column(int(random.choice([1, 2, 3, 5])), "a")])
        elif what == "less":
            regression = regression.without(random.choice(["a", "b"]))
        elif what == "replace":  # column 6, which no regression has here
            rows[:, :, 6] = random.normal(size=(BLOCKS, ROWS))
            products = np.einsum("bri,brj->bij", rows, rows[:, :, 6:])
            b = Blocks(b.white.replaced(np.array([6]), list(products)), b.squares, b.rows)
            regression = regression.on(b)
        else:  # fewer rows count
            rows[:, : ROWS // 4] = 0.0
            whole = np.einsum("bri,brj->bij", rows, rows)
            b = Blocks(gram_of(whole), b.squares, b.rows)
            regression = regression.with_columns(b, [])
        weights = random.choice([everywhere, np.array([1.0, 0.0, 1.0])])
        again = Regression(b, list(regression.columns))
        for kept, direct in zip(regression.normal(weights), again._add_normal(None, weights), strict=True):
            prior = np.diag(regression.precision) if kept.ndim == 2 else regression._pull
            np.testing.assert_allclose(kept, direct + prior, rtol=1e-6, atol=1e-6)


@given(seed=st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=30)
def test_projected_candidates_explain_what_direct_least_squares_explains(seed):
    b, rows, _ = blocks(np.random.default_rng(seed), 1)
    everywhere = np.ones(BLOCKS)
    regression = Regression(b, [Column(k, everywhere) for k in range(2)])
    competition = regression.compete(np.array([2, 5]), everywhere)
    coefficients = np.linalg.solve(competition.schur, competition.products)
    flat = rows.reshape(-1, rows.shape[2])
    y, own, both = flat[:, FIXED], flat[:, :2], flat[:, [0, 1, 2, 5]]
    left = [np.sum((y - X @ np.linalg.lstsq(X, y, rcond=None)[0]) ** 2) for X in (own, both)]
    assert competition.products @ coefficients == pytest.approx(left[0] - left[1], rel=1e-6)
    np.testing.assert_allclose(coefficients, np.linalg.lstsq(both, y, rcond=None)[0][2:], rtol=1e-6, atol=1e-9)
    scores = regression.scores(competition, np.array([2, 5]), everywhere)
    np.testing.assert_allclose(scores.sum(axis=0), competition.products, rtol=1e-6, atol=1e-6)


def test_a_design_with_more_columns_leaves_the_design_unchanged(model, robot):
    segments = [recording(model, k, rows=200) for k in range(2)]
    only = frozenset({"offset_shift"})
    design = set_up(Comparison(model, robot, segments, [], only, frozenset()), lambda _: None).design
    before = design.blocks.white.take(slice(None), np.arange(5), np.arange(5)).copy()
    ramp = [np.linspace(0, 1, len(s.P))[:, None] for s in segments]
    more, indices = design.with_columns(ramp)
    assert (design.blocks.white.size, more.blocks.white.size) == (indices[0], indices[0] + 1)
    np.testing.assert_allclose(more.values(1, indices), ramp[1], atol=1e-6)
    other = more.with_replaced(indices, [2 * values for values in ramp])
    np.testing.assert_allclose(more.values(1, indices), ramp[1], atol=1e-6)
    for block in range(len(design.parts)):
        twice, once = (each.blocks.white.take(block, indices, indices) for each in (other, more))
        np.testing.assert_allclose(twice / once, 4.0, rtol=1e-6)
        np.testing.assert_allclose(other.blocks.squares[block, indices], 4 * more.blocks.squares[block, indices])
        part = more.parts[block]
        own = more.values(part.segment, indices, part.own)[more.trusted[block]]
        np.testing.assert_allclose(more.blocks.squares[block, indices], (own**2).sum(axis=0))
    np.testing.assert_array_equal(before, design.blocks.white.take(slice(None), np.arange(5), np.arange(5)))
