"""Paths of loads that switch: C equals numpy, and both find the best of all paths."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.discrepancy.loads.paths import (
    lasting,
    lasting_in_numpy,
    library,
    likeliest,
    likeliest_in_numpy,
    viterbi,
)


def drawn(seed, rows):
    random = np.random.default_rng(seed)
    return random.normal(0, 2, rows), random.normal(-2, 2, rows), random.normal(-2, 2, rows)


@given(st.integers(0, 9999), st.integers(1, 400), st.integers(1, 60), st.sampled_from((-3.0, 0.7, 5.0)))
def test_c_equals_numpy(seed, rows, dwell, size):
    if library() is None:
        pytest.skip("no C compiler")
    random = np.random.default_rng(seed)
    white = random.normal(0, 1, (5, rows))
    white[[1, 3]] **= 2
    path, same = (find(white, size, 2.0, dwell) for find in (likeliest, likeliest_in_numpy))
    assert (path.on == same.on).all()
    assert path[1:] == pytest.approx(same[1:], rel=1e-9, abs=1e-9)
    noisy = random.random(rows) < 0.5
    assert (lasting(noisy, dwell) == lasting_in_numpy(noisy.copy(), dwell)).all()


@given(st.integers(0, 9999), st.integers(2, 9))
def test_no_other_path_is_likelier(seed, rows):
    stay, rise, fall = drawn(seed, rows)

    def worth(path):
        total = stay[0] - 1.0 if path[0] else 0.0
        for k in range(1, rows):
            total += (rise[k] if path[k] else fall[k]) if path[k] != path[k - 1] else 0.0
            total += stay[k] if path[k] else 0.0
        return total

    best = max(worth(path) for path in itertools.product((False, True), repeat=rows))
    assert worth(viterbi(stay, rise, fall).tolist()) == pytest.approx(best)
