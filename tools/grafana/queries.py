"""What the dashboard asks PostgreSQL and Prometheus.

Macros of Grafana's PostgreSQL data source: https://grafana.com/docs/grafana/latest/datasources/postgres/
"""

from __future__ import annotations

_ROWS_UP_TO_S = 1800
"""Longer spans come from the one-minute roll-ups: half an hour has 45 000 rows per channel."""
_SPAN_S = "$__unixEpochTo() - $__unixEpochFrom()"
_DEVICE = "device = ${device:sqlstring}"
_IN_SPAN = (  # only `filetime` has an index
    "filetime BETWEEN ($__unixEpochFrom() + 11644473600) * 10000000 AND ($__unixEpochTo() + 11644473600) * 10000000"
)
_CHANNELS = "channel IN (${channel:sqlstring})"

DEVICES = (
    "WITH RECURSIVE known AS (SELECT min(device) AS device FROM power UNION ALL"
    " SELECT (SELECT min(device) FROM power WHERE power.device > known.device) FROM known WHERE device IS NOT NULL)"
    " SELECT device FROM known WHERE device IS NOT NULL"
)
"""One seek in the key per device, no scan."""


def over_time(quantity: str) -> str:
    """Means of a quantity per channel: of rows over a short span, of roll-ups over a long one."""
    return (
        f'SELECT $__timeGroup("time", $__interval) AS "time", channel AS metric, avg("{quantity}") AS value'
        f" FROM power WHERE {_DEVICE} AND {_CHANNELS} AND {_IN_SPAN} AND {_SPAN_S} <= {_ROWS_UP_TO_S} GROUP BY 1, 2"
        f' UNION ALL SELECT "start", channel, "{quantity}" FROM v_power_1min'
        f' WHERE {_DEVICE} AND {_CHANNELS} AND $__unixEpochFilter("start") AND {_SPAN_S} > {_ROWS_UP_TO_S}'
        " ORDER BY 1"
    )


def latest(quantity: str) -> str:
    """The newest value of all phases together."""
    return (
        f'SELECT "time", "{quantity}" AS value FROM power WHERE {_DEVICE} AND channel = \'total\''
        " ORDER BY filetime DESC LIMIT 1"
    )


ENERGY = (
    'SELECT max("W") - min("W") AS value FROM v_power_15min'
    f" WHERE {_DEVICE} AND channel = 'total' AND $__unixEpochFilter(\"start\")"
)
"""kWh between the first and the last quarter of an hour of the span."""
COST = f'SELECT sum("EUR") AS value FROM v_energy_quarter WHERE {_DEVICE} AND $__timeFilter("time")'
"""EUR in the span, by the quarter hours that `acqd sink` stores where [energy] has a tariff."""
COST_BY_HOUR = (
    'SELECT date_trunc(\'hour\', "time") AS "time", sum("EUR") AS cost FROM v_energy_quarter'
    f' WHERE {_DEVICE} AND $__timeFilter("time") GROUP BY 1 ORDER BY 1'
)
PRICE = (
    'SELECT date_trunc(\'hour\', "time") AS "time", sum("EUR") / nullif(sum("kWh"), 0) AS price'
    f' FROM v_energy_quarter WHERE {_DEVICE} AND "EUR" IS NOT NULL AND $__timeFilter("time") GROUP BY 1 ORDER BY 1'
)
"""EUR per kWh that was paid."""
WITHOUT_ROWS = (
    'SELECT date_trunc(\'hour\', "time") AS "time", sum(missing_s) AS seconds FROM v_energy_quarter'
    f' WHERE {_DEVICE} AND $__timeFilter("time") GROUP BY 1 ORDER BY 1'
)
"""Of the quarter hours that have some rows; the others are gaps of the series."""
FLAGGED = (
    'SELECT "time", channel AS metric, flagged::float / greatest("rows", 1) AS value FROM v_power_1min'
    f' WHERE {_DEVICE} AND {_CHANNELS} AND $__unixEpochFilter("start") ORDER BY 1'
)
PREDICTION = (
    'SELECT $__timeGroup("time", $__interval) AS "time", avg("P") AS measured, avg("P_predicted") AS predicted'
    f' FROM v_prediction WHERE {_DEVICE} AND $__timeFilter("time") GROUP BY 1 ORDER BY 1'
)
RESIDUAL = (
    'SELECT $__timeGroup("time", $__interval) AS "time", avg(residual) AS residual'
    f' FROM v_prediction WHERE {_DEVICE} AND $__timeFilter("time") GROUP BY 1 ORDER BY 1'
)
HEALTH = {
    "Ready": ("acqd_ready", "{{service}} {{name}}", "short"),
    "Connected": ("acqd_connected", "{{service}} {{peer}}", "short"),
    "Rows": ("rate(acqd_rows_total[$__rate_interval])", "{{service}} {{name}}", "rowsps"),
    "Messages waiting": ("acqd_messages_waiting", "{{name}}", "short"),
    "Spool": ("acqd_spool_bytes", "{{name}}", "decbytes"),
    "Late cycles": ("rate(acqd_cycles_late_total[$__rate_interval])", "{{name}}", "cps"),
}
"""Title: expression, legend, unit."""
