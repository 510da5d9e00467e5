"""Batches."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from acqd.models.networks.batches import Example, batches


@given(st.lists(st.integers(1, 60), min_size=1, max_size=40), st.integers(1, 12), st.sampled_from([0, 2, 20]))
def test_batches_are_sorted_and_truncated_to_their_shortest(lengths, size, margin):
    examples = [
        Example(np.full((n + margin, 2), k, np.float32), np.full(n, k, np.float32)) for k, n in enumerate(lengths)
    ]
    made = batches(examples, size, margin)
    assert sum(len(batch.target) for batch in made) == len(lengths)
    shortest = [batch.target.shape[1] for batch in made]
    assert shortest == sorted(shortest) and shortest == sorted(lengths)[::size]
    assert all(batch.inputs.shape[1] == batch.target.shape[1] + margin for batch in made)
    assert all((batch.inputs[:, 0, 0] == batch.target[:, 0]).all() for batch in made)
