"""Pauses between attempts."""

from __future__ import annotations

import numpy as np

from acqd.sources.backoff import Backoff


def test_the_pauses_of_the_back_off_grow_and_stay_bounded():
    backoff, now, tries = Backoff(500, 8_000), 0, []
    while now < 200_000:
        if backoff.due(now):
            tries.append(now)
        now += 10
    pauses = np.diff(tries)
    assert pauses[0] <= 510 and max(pauses) <= 8_010 and min(pauses[6:]) >= 5_990
    backoff.reset()
    assert backoff.due(now)
