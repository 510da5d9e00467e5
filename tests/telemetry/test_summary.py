"""Summaries of one second."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.telemetry.summary import Summariser
from tests.telemetry.rows import some_rows


def test_summaries_come_once_a_second_and_add_up():
    _, batch, rows = some_rows(seconds=3.2, utc_ns=10**18)
    summariser = Summariser()
    summaries = summariser.add(batch, rows)
    assert len(summaries) == 3 * 4
    first = [row for row in rows if row.channel == "L2"][:25]
    second = next(s for s in summaries if s["channel"] == "L2")
    assert second["rows"] == 25 and second["time"] == "2001-09-09T01:46:40.000000Z"
    assert second["P"] == pytest.approx(np.mean([row.P for row in first]))
    assert second["Vrms"] == pytest.approx(np.sqrt(np.mean([row.Vrms**2 for row in first])))
    assert second["W"] == first[-1].W == pytest.approx(second["W_import"] - second["W_export"])
