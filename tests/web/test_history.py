"""Past values for charts."""

from __future__ import annotations

import pytest

from acqd.storage.database import open_database, read_database
from acqd.storage.maintain import Retention, maintain
from acqd.storage.writer import Writer
from acqd.web.history import Span, devices, history
from tests.storage.rows import T0, message, row


def stored(database, rows):
    engine = open_database(database)
    Writer(engine).write([message(each) for each in rows])
    return engine


def test_a_minute_has_every_row_as_it_is_stored(database):
    engine = stored(database, [row(k, t=T0 + 0.04 * k, P=100.0 + k) for k in range(1500)])
    past = history(engine, Span(row(0).device, 60), T0 + 60)
    (P,) = past["channels"].values()
    assert past["from"] == "power" and [100.0 + k for k in range(1500)] == P
    assert past["time"] == pytest.approx([T0 + 0.04 * k for k in range(1500)], abs=1e-4)
    assert devices(engine) == [row(0).device] and not history(engine, Span("other", 60), T0 + 60)["time"]


def test_a_longer_span_has_means_and_energy_has_readings(database):
    engine = stored(database, [row(k, t=T0 + k, P=float(k), W=0.001 * k) for k in range(1200)])
    past = history(engine, Span(row(0).device, 1800), T0 + 1800)
    (P,) = past["channels"].values()
    assert len(P) <= 1500 and sum(P) / len(P) == pytest.approx(599.5, abs=2)
    (W,) = history(engine, Span(row(0).device, 1800, "W"), T0 + 1800)["channels"].values()
    assert max(W) == pytest.approx(1.199) and sorted(W) == W


def test_hours_come_from_roll_ups_and_what_is_newer_from_rows(database):
    engine = stored(database, [row(k, t=T0 + 2.0 * k, P=100.0) for k in range(600)])
    maintain(engine, Retention(power_days=0), T0 + 1200)
    Writer(engine).write([message(row(5000, t=T0 + 1230, P=300.0))])
    past = history(engine, Span(row(0).device, 21600), T0 + 1260)
    (P,) = past["channels"].values()
    assert past["from"] == "power_1min" and [pytest.approx(100.0)] * 20 + [pytest.approx(300.0)] == P
    assert past["time"][-1] == T0 + 1200


def test_a_viewer_neither_creates_nor_guesses(tmp_path):
    from acqd.errors import UserError

    with pytest.raises(UserError, match="no such file"):
        read_database(str(tmp_path / "none.sqlite"))
    assert not list(tmp_path.iterdir())
    for wrong in ({"quantity": "P; DROP TABLE power"}, {"seconds": 0}, {"seconds": float("nan")}):
        with pytest.raises(ValueError, match="expected"):
            Span(**{"device": "acqd", "seconds": 60, **wrong})
