"""Codes with an offset become codes of 16 bits."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.sources.recording.channel import Column
from acqd.sources.recording.steps import steps_of


@pytest.mark.parametrize(
    ("kind", "scale", "offset_steps", "rounded"),
    [
        ("i2", 0.01, 0, 0), ("i2", 0.01, 300, 0), ("u2", 0.01, -32_768, 0), ("u2", -0.01, 32_767, 0),
        (">i2", 0.02, -5, 0), ("i1", 0.5, 3, 0), ("u1", 0.5, -127, 0), ("u1", -0.5, 127.3, 1 / 128),
        ("i1", 2.0, 0.37, 1 / 128),
    ],
)  # fmt: skip
def test_values_stay_what_they_were(kind, scale, offset_steps, rounded):
    info = np.iinfo(kind)
    values = np.linspace(info.min / 2 + info.max / 2 - info.max / 4, info.max * 0.99, 50).astype(kind)
    column = Column(values, scale, offset_steps * abs(scale))
    steps, codes = steps_of(column), np.empty((50, 2), np.int16)
    got = steps.into(codes[:, 1], values) * codes[:, 1].astype(np.float64)
    np.testing.assert_allclose(got, column.physical(), atol=(rounded + 1e-9) * abs(scale))


def test_what_does_not_fit_stays_as_it_is():
    full = np.array([-32_768, 32_767], np.int16)
    for column in (
        Column(full, 0.01, 0.01), Column(full, 0.01, 0.005), Column(full.astype(np.int32), 0.01),
        Column(full.astype(float), 0.01), Column(full, 0.0), Column(full, 0.01, np.inf), Column(full[:0], 0.01),
        Column(np.array([0, 255], np.uint8), 1e-3, 1.0004),
    ):  # fmt: skip
        assert steps_of(column) is None
