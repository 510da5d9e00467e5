"""Metering of arrays."""

import numpy as np
import pytest

import acqd
from tests.mains import make_mains


def test_pieces_of_any_length_give_the_same_windows():
    mains = make_mains(50.03, seconds=2.0, harmonics={3: 0.05})
    u, i = mains.codes[:, 0::2] * mains.scale[0], mains.codes[:, 1::2] * mains.scale[1]
    whole = acqd.Meter(mains.rate, phases=3, start_ns=10**18).feed(u, i)
    meter = acqd.Meter(mains.rate, phases=3, start_ns=10**18)
    parts = [meter.feed(u[k : k + 1_234], i[k : k + 1_234]) for k in range(0, len(u), 1_234)]
    joined = acqd.WindowBatch.join(parts)
    assert len(joined) == len(whole) == 50
    assert joined.utc_ns[0] == 10**18 and joined.utc_ns[1] - joined.utc_ns[0] == 40_000_000
    np.testing.assert_allclose(joined.P[:, 3:], mains.P, rtol=2e-4)
    np.testing.assert_allclose(joined.P[:, 3:], whole.P[:, 3:], rtol=1e-6)
    np.testing.assert_allclose(whole.f[3:], 50.03, atol=2e-3)


def test_what_cannot_be_metered_is_named():
    with pytest.raises(acqd.UserError, match="sampling rate 5 Hz"):
        acqd.Meter(5)
    with pytest.raises(acqd.UserError, match="window 1 s"):
        acqd.Meter(20_000, window_s=1)
    meter = acqd.Meter(20_000)
    with pytest.raises(acqd.UserError, match="i has the shape"):
        meter.feed(np.zeros(100), np.zeros(99))
    with pytest.raises(acqd.UserError, match="u holds NaN or infinity at sample 7"):
        meter.feed(np.where(np.arange(100) == 7, np.nan, 0.0), np.zeros(100))
    assert len(meter.feed(np.zeros(100), np.zeros(100))) == 0
