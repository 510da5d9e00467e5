"""Power of another time than the motion."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.another_time import another_time
from acqd.models.metrics import predictions
from tests.builders import STEP, recording


@pytest.fixture(scope="module")
def asked(model):
    return [recording(model, k, seed=3) for k in range(4)]


def said(model, segments):
    subject = SimpleNamespace(model=model, fit=segments[:3], held_out=segments[3:], data=SimpleNamespace(step_s=STEP))
    return another_time(subject)


@pytest.mark.parametrize(("rows", "words"), [(41, "1.64 s after"), (-100, "4.00 s before")])
def test_power_far_from_its_motion_is_said(model, asked, rows, words):
    assert words in said(model, [replace(s, P=np.roll(s.P, rows)) for s in asked])


def test_what_the_loop_corrects_or_explains_is_no_other_time(model, asked):
    assert said(model, asked) == "" == said(model, [replace(s, P=np.roll(s.P, 10)) for s in asked])
    assert said(model, [replace(s, P=np.roll(s.P, 60 * k)) for k, s in enumerate(asked)]) == ""  # no common delay
    assert said(model, [replace(s, P=np.roll(s.P, 41)) for s in asked[:2]]) == ""
    moved = [np.roll(predicted, 41) for predicted in predictions(model, asked)]
    loads = [500.0 * (power > np.median(power)) for power in moved]  # a process that follows the motion
    assert said(model, [replace(s, P=s.P + load) for s, load in zip(asked, loads, strict=True)]) == ""
