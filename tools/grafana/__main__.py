"""Write config/grafana/dashboards/acqd.json: python -m tools.grafana (needs grafana-foundation-sdk, `acqd[grafana]`).

Grafana itself is in none of the registries that this project builds from: the model comes from Grafana's own SDK, and
a test runs the queries in PostgreSQL and Prometheus.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from grafana_foundation_sdk.builders import dashboard, prometheus, stat, timeseries
from grafana_foundation_sdk.cog.encoder import JSONEncoder
from grafana_foundation_sdk.models.dashboard import DataSourceRef, GridPos, VariableOption

from tools.grafana import queries

OUT = Path(__file__).parents[2] / "config" / "grafana" / "dashboards" / "acqd.json"
ROWS = DataSourceRef(type_val="grafana-postgresql-datasource", uid="acqd-rows")
HEALTH = DataSourceRef(type_val="prometheus", uid="acqd-health")
_QUANTITIES = {
    "P": ("Power", "watt"), "Vrms": ("Voltage", "volt"), "Irms": ("Current", "amp"),
    "PF": ("Power factor", "none"), "f": ("Frequency", "hertz"), "W": ("Net energy", "kwatth"),
}  # fmt: skip
_HALF, _THIRD, _HIGH = 12, 8, 8


class Sql:
    """A query of the PostgreSQL data source, which the SDK has no model of."""

    def __init__(self, text: str, form: str) -> None:
        self._json = {"refId": "A", "datasource": ROWS, "format": form, "rawQuery": True, "rawSql": text}

    def build(self) -> Sql:
        """Complete as it is."""
        return self

    def to_json(self) -> dict[str, object]:
        """As Grafana stores it."""
        return self._json


def made() -> str:
    """The dashboard as text."""
    board = (
        dashboard.Dashboard("acqd: power and health")
        .uid("acqd-power")
        .description("Rows and predictions from PostgreSQL, health of daemon and sink from Prometheus.")
        .tags(["acqd", "energy"])
        .time("now-15m", "now")
        .refresh("5s")
        .with_variable(_devices())
        .with_variable(_channels())
    )
    place = _Places()
    for panel in [*_power(place), *_cost(place), *_prediction(place), *_health(place)]:
        board = board.with_panel(panel)
    model = json.loads(json.dumps(board.build(), cls=JSONEncoder))
    return json.dumps(_without_nulls(model), indent=1, sort_keys=True) + "\n"


def _without_nulls(value: Any) -> Any:
    """What the SDK leaves empty is Grafana's to choose."""
    if isinstance(value, dict):
        return {key: _without_nulls(each) for key, each in value.items() if each is not None}
    return [_without_nulls(each) for each in value] if isinstance(value, list) else value


class _Places:
    """Places panels from left to right, 24 columns a row."""

    def __init__(self) -> None:
        self._x = self._y = 0

    def next(self, width: int) -> GridPos:
        """The next free place."""
        if self._x + width > 24:
            self._x, self._y = 0, self._y + _HIGH
        place = GridPos(h=_HIGH, w=width, x=self._x, y=self._y)
        self._x += width
        return place


def _devices() -> dashboard.QueryVariable:
    return dashboard.QueryVariable("device").label("Device").datasource(ROWS).query(queries.DEVICES)


def _channels() -> dashboard.CustomVariable:
    every = ["L1", "L2", "L3", "total"]
    options = [VariableOption(selected=True, text=name, value=name) for name in every]
    chosen = VariableOption(selected=True, text=every, value=every)
    return dashboard.CustomVariable("channel").label("Channel").values(",".join(every)).options(options).multi(
        True
    ).current(chosen)  # fmt: skip


def _power(place: _Places) -> list[Any]:
    panels = [
        _number("Power now", queries.latest("P"), "watt", place),
        _number("Energy in this span", queries.ENERGY, "kwatth", place),
        _number("Frequency now", queries.latest("f"), "hertz", place),
    ]
    panels += [_lines(title, queries.over_time(name), unit, place) for name, (title, unit) in _QUANTITIES.items()]
    return [*panels, _lines("Flagged rows", queries.FLAGGED, "percentunit", place)]


def _cost(place: _Places) -> list[Any]:
    return [
        _number("Cost in this span", queries.COST, "currencyEUR", place),
        _lines("Cost by hour", queries.COST_BY_HOUR, "currencyEUR", place),
        _lines("Price paid, EUR per kWh", queries.PRICE, "currencyEUR", place),
        _lines("Without rows, by hour", queries.WITHOUT_ROWS, "s", place),
    ]


def _prediction(place: _Places) -> list[Any]:
    return [
        _lines("Measured and predicted power", queries.PREDICTION, "watt", place),
        _lines("Residual: measured - predicted", queries.RESIDUAL, "watt", place),
    ]


def _health(place: _Places) -> list[Any]:
    return [_metric(title, *about, place) for title, about in queries.HEALTH.items()]


def _number(title: str, query: str, unit: str, place: _Places) -> Any:
    panel: Any = stat.Panel().title(title).datasource(ROWS).unit(unit).grid_pos(place.next(_THIRD))
    return panel.with_target(Sql(query, "table"))


def _lines(title: str, query: str, unit: str, place: _Places) -> Any:
    panel: Any = timeseries.Panel().title(title).datasource(ROWS).unit(unit).grid_pos(place.next(_HALF))
    return panel.with_target(Sql(query, "time_series"))


def _metric(title: str, expression: str, legend: str, unit: str, place: _Places) -> Any:
    query = prometheus.Dataquery().expr(expression).legend_format(legend).ref_id("A")
    panel: Any = timeseries.Panel().title(title).datasource(HEALTH).unit(unit).grid_pos(place.next(_THIRD))
    return panel.with_target(query)


if __name__ == "__main__":
    OUT.write_text(made(), encoding="utf-8")
    print(f"wrote {OUT}")
