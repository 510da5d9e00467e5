"""The arm of the closing report: its layers add up to the prediction, and to the residual of the model before."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.report.arm import _motion, arm_view
from acqd.models.augmented import Augmented
from acqd.models.metrics import predictions
from tests.builders import ROBOT, STEP, grey, recording
from tests.discrepancy.report.subjects import found, subject_with


def means(values, rows):
    return values[: 3 * rows].reshape(rows, 3).mean(axis=1)


def test_a_segment_shorter_than_a_row_of_the_view_is_one_row():
    model = grey()
    whole = recording(model, 1, rows=120)
    for rows in (1, 2, 4):
        cut = replace(whole, q=whole.q[:rows], P=whole.P[:rows], channels={},
                      signals={name: values[:rows] for name, values in whole.signals.items()})  # fmt: skip
        motion = _motion(cut, model, model, STEP)
        assert len(motion.t) == len(motion.q) == len(motion.measured) == 1


def test_layers_add_up_to_the_prediction_and_to_the_residual_before():
    before = grey()
    held_out = [recording(before, k, rows=120) for k in range(4)]
    load = found("offset_shift", {"power": (2.0, 0.4)}, where="cabinet", unit="W").term
    load = replace(load, coefficients=np.array([2.0]))
    after = Augmented(before, before, [load])
    subject = subject_with(
        before, held_out=held_out, data=SimpleNamespace(step_s=STEP, measured="simulated"), robot=ROBOT
    )
    subject.model = before
    errors = [[s.P - p for s, p in zip(held_out, predictions(m, held_out), strict=True)] for m in (before, after)]
    closed = SimpleNamespace(
        subject=subject, errors_before=errors[0], errors_after=errors[1], extended=True,
        improved=SimpleNamespace(model=lambda _: after),
    )  # fmt: skip
    view = arm_view(closed)
    assert view.caption.startswith("Simulated data. ")
    assert len(view.motions) == 3 and len(view.frames["joints"]) == ROBOT.axes
    for motion in view.motions:
        k = next(k for k, segment in enumerate(held_out) if segment.recording == motion.name)
        rows = len(motion.t)
        predicted = sum(layer.joints.sum(axis=1) for layer in motion.predicted)
        assert predicted == pytest.approx(means(held_out[k].P - errors[1][k], rows), abs=1e-6)
        residual = sum(layer.joints.sum(axis=1) for layer in motion.residual)
        assert residual == pytest.approx(means(errors[0][k], rows), abs=1e-6)
        assert [layer.name for layer in motion.residual] == ["offset_shift (cabinet)", "unexplained"]
        assert motion.residual[0].joints.sum(axis=1) == pytest.approx(np.full(rows, 2.0))
    assert '"name":"offset_shift (cabinet)","colour":"#' in view.data()
