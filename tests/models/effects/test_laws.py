"""Laws without a name."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from acqd.models.augmented import Augmented, Term
from acqd.models.effects import holdable, library
from acqd.models.effects.laws import laws
from acqd.models.effects.laws.law import MotionRange
from acqd.models.effects.laws.torque_laws import play
from acqd.models.effects.scene import segment_scene
from acqd.models.predictor import Stream
from tests.builders import AXES, grey, motion, recording

RANGE = MotionRange(
    np.full(AXES, -1.0), np.full(AXES, 1.0), np.full(AXES, 2.0), np.full(AXES, 50.0), np.linspace(80.0, 200.0, 4)
)


@pytest.mark.parametrize("law", laws().values(), ids=lambda law: law.id)
def test_a_law_has_as_many_columns_as_it_says_and_one_quantity(law):
    model = grey()
    scene = segment_scene(model, recording(model, 1, rows=80))
    for joint in law.joints(AXES):
        shape = law.shape_of(RANGE, joint)
        assert law.at(scene, shape).shape == (len(scene.q), law.count(AXES))
        along = law.along(scene, shape)
        assert along.values.shape == (len(scene.q),) and along.unit
        assert along.name and "{" not in law.label(joint)
    assert law.summary and "{" not in law.summary
    assert law.equation and law.experiment and bool(law.c_body) == law.exported != bool(law.omitted_because)


def test_laws_are_no_effects_of_the_library():
    assert not set(laws()) & set(library()) and set(holdable()) == set(laws()) | set(library())
    model = grey()
    scene = segment_scene(model, recording(model, 1, rows=30))
    assert not any(list(law.places(scene)) for law in laws().values())
    labels = [law.label(joint) for law in laws().values() for joint in law.joints(AXES)]
    assert len(set(labels)) == len(labels)


@pytest.mark.parametrize("law", [law for law in laws().values() if law.per_joint and law.acts_on == "torque"],
                         ids=lambda law: law.id)  # fmt: skip
def test_a_torque_law_acts_on_its_joint_only(law):
    model = grey()
    scene = segment_scene(model, recording(model, 1, rows=80))
    shape = law.shape_of(RANGE, 2)
    for joint in range(AXES):
        assert law.at(scene.unit_torque(joint), shape).any() == (joint == 1)


@pytest.mark.parametrize("law", laws().values(), ids=lambda law: law.id)
def test_a_stream_of_rows_gives_what_a_whole_recording_gives(law):
    """Also after a rest that is longer than the rows that a stream keeps: a play stays where it was."""
    model = grey()
    moved = motion(60, AXES, 3)
    rest = np.repeat(moved[39:40], 90, axis=0)
    q = np.concatenate([moved[:40], rest, moved[40:], np.repeat(moved[-1:], 20, axis=0)])
    shape = law.shape_of(RANGE, 2 if law.per_joint else 0)
    columns = tuple(range(law.count(AXES)))
    term = Term(law.id, "joint 2", shape, columns, np.linspace(1.0, 3.0, len(columns)), {})
    corrected = Augmented.of(model, model, [term])
    brake = np.ones((len(q), 1))
    whole = corrected.sequence(q, brake)
    stream = Stream(corrected)
    rows = [stream.step(*each) for each in zip(q, brake, strict=True)][corrected.radius :] + stream.finish()
    assert np.array(rows) == pytest.approx(whole, abs=1e-3)
    assert np.abs(whole - model.sequence(q, brake)).max() > 0.1


@given(arrays(float, st.integers(1, 40), elements=st.floats(-10, 10)), st.floats(0, 5), st.floats(-20, 20))
@settings(max_examples=60)
def test_a_play_follows_row_by_row_at_a_distance_of_its_half_width(values, width, start):
    at, expected = start, []
    for value in values:
        at = min(max(at, value - width), value + width)
        expected.append(at)
    np.testing.assert_array_equal(play(values, width, start), expected)
