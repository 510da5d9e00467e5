"""A ring that is closed after the test."""

from __future__ import annotations

import os

import pytest

from acqd.plc.ring import Ring, RingLayout
from tests.plc.counting import RATE


@pytest.fixture
def ring():
    ring, fd = Ring.create(RingLayout(RATE, 2, 20_000))
    yield ring
    os.close(fd)
