"""Chains of motions, blended into each other."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from acqd.motion.chain import Move, plan_chain
from tests.lab.moved import IIWA


@given(st.integers(0, 10_000))
@example(369)  # a leg that ends before the one before it
@settings(max_examples=25)
def test_a_blended_chain_keeps_every_limit(seed):
    random = np.random.default_rng(seed)
    points = random.uniform(IIWA.lower, IIWA.upper, (8, 7))
    moves = [Move(q, float(random.uniform(0.2, 0.5)), 0.2, 1 - float(random.uniform(0, 0.5))) for q in points]
    chain = plan_chain(np.zeros(7), moves, IIWA.speed, IIWA.acceleration)
    q, qd, qdd = chain.sample(np.arange(0, chain.duration + 0.01, 1e-3))
    assert (np.abs(qd) <= 0.5 * IIWA.speed * (1 + 1e-6)).all()
    assert (np.abs(qdd) <= 0.4 * IIWA.acceleration * (1 + 1e-6)).all()
    assert (q >= IIWA.lower - 1e-9).all() and (q <= IIWA.upper + 1e-9).all()
    np.testing.assert_allclose(q[-1], points[-1], atol=1e-9)
    np.testing.assert_allclose(np.gradient(q, 1e-3, axis=0), qd, atol=2e-3)
    np.testing.assert_allclose(np.gradient(qd, 1e-3, axis=0), qdd, atol=0.08)
    starts = [leg.start for leg in chain.legs]
    assert starts == sorted(starts)
    assert all(later.start >= earlier.end - 1e-9 for earlier, later in zip(chain.legs, chain.legs[2:], strict=False))


def test_blending_saves_time_and_cuts_the_corner_but_not_without_it():
    corner = [np.array([0.6, 0, 0, 0, 0, 0, 0]), np.array([0.6, 0.6, 0, 0, 0, 0, 0])]
    sharp = plan_chain(np.zeros(7), [Move(q, 0.4, 0.2) for q in corner], IIWA.speed, IIWA.acceleration)
    soft = plan_chain(np.zeros(7), [Move(q, 0.4, 0.2, 0.6) for q in corner], IIWA.speed, IIWA.acceleration)
    assert soft.duration < sharp.duration - 0.1

    def nearest(chain):
        q = chain.sample(np.arange(0, chain.duration, 1e-3))[0]
        return np.linalg.norm(q - corner[0], axis=1).min()

    assert nearest(sharp) < 1e-3 < 0.02 < nearest(soft)
