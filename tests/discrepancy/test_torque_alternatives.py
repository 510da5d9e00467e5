"""Unnamed torque laws."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from acqd.discrepancy.regression.torque_alternatives import play, torque_columns, torque_groups
from acqd.models.effects.scene import segment_scene
from tests.builders import AXES, grey, recording


@given(st.lists(st.floats(-3, 3), min_size=2, max_size=60), st.floats(0.01, 1.0))
def test_play_follows_within_its_width_and_only_when_pushed(values, width):
    followed = play(np.array(values)[:, None], np.array([width]))[:, 0]
    assert np.all(np.abs(followed - values) <= width + 1e-12)
    moved = np.diff(followed) != 0
    assert np.all(np.abs(followed - values)[1:][moved] >= width - 1e-12)


def test_as_many_columns_as_the_groups_say():
    model = grey()
    scene = segment_scene(model, recording(model, 1, rows=60))
    columns = torque_columns(scene, (np.full(AXES, -3.0), np.full(AXES, 3.0)), np.ones(AXES), np.ones(AXES))
    groups = torque_groups(AXES)
    assert len(columns) == sum(count for _, count in groups) and len({name for name, _ in groups}) == len(groups)
    assert all(column.shape == (len(scene.q),) and np.isfinite(column).all() for column in columns)
