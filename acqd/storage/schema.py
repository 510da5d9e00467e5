"""The tables as SQLAlchemy sees them; `migrations/` creates them."""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql

from acqd.telemetry import quality_row, register_row

metadata = sa.MetaData()
_JSON = sa.JSON().with_variant(postgresql.JSONB(), "postgresql")
_LIST = sa.JSON(none_as_null=True).with_variant(postgresql.JSONB(none_as_null=True), "postgresql")
_TIME = sa.Text().with_variant(sa.DateTime(timezone=True), "postgresql")
_BIG = sa.BigInteger().with_variant(sa.Integer(), "sqlite")

power = sa.Table(
    "power",
    metadata,
    sa.Column("device", sa.Text, nullable=False),
    sa.Column("channel", sa.Text, nullable=False),
    sa.Column("boot", sa.Text, nullable=False),
    sa.Column("seq", _BIG, nullable=False),
    sa.Column("time", _TIME, nullable=False),
    sa.Column("filetime", _BIG, nullable=False),
    *(sa.Column(name, sa.Double) for name in ("Vrms", "Irms", "P", "S", "PF", "f", "W")),
    sa.Column("flags", _JSON, nullable=False),
    sa.Column("schema", sa.SmallInteger, nullable=False),
    sa.PrimaryKeyConstraint("device", "channel", "boot", "seq"),
)
"""One row per window and channel. SQLite keeps `time` as RFC 3339 text, PostgreSQL as timestamptz.

In SQLite it is a view of rows with numbers instead of names (`storage.numbered_rows`).
"""

power_row = sa.Table("power_row", sa.MetaData(), sa.Column("id", _BIG, primary_key=True), sa.Column("filetime", _BIG))
"""What is deleted by its time in SQLite."""

power_quality = sa.Table(
    "power_quality",
    metadata,
    *(sa.Column(name, sa.Text, nullable=False) for name in ("device", "channel", "boot")),
    sa.Column("seq", _BIG, nullable=False),
    sa.Column("time", _TIME, nullable=False),
    sa.Column("filetime", _BIG, nullable=False),
    sa.Column("aggregation", sa.Text, nullable=False),
    sa.Column("duration", sa.Double),
    sa.Column("intervals", sa.Integer, nullable=False),
    sa.Column("flags", _JSON, nullable=False),
    *(sa.Column(name, sa.Double) for name in quality_row.NUMBERS),
    sa.Column("rotation", sa.Text),
    *(sa.Column(name, _LIST) for name in quality_row.LISTS),
    sa.Column("schema", sa.SmallInteger, nullable=False),
    sa.PrimaryKeyConstraint("device", "channel", "boot", "seq"),
)
"""One row per aggregation interval and channel; harmonics and interharmonics as JSON arrays of 50 numbers."""

power_register = sa.Table(
    "power_register",
    metadata,
    *(sa.Column(name, sa.Text, nullable=False) for name in ("device", "channel", "boot")),
    sa.Column("seq", _BIG, nullable=False),
    sa.Column("time", _TIME, nullable=False),
    sa.Column("filetime", _BIG, nullable=False),
    *(sa.Column(name, sa.Double) for name in register_row.NUMBERS),
    sa.Column("schema", sa.SmallInteger, nullable=False),
    sa.PrimaryKeyConstraint("device", "channel", "boot", "seq"),
    sa.Index("power_register_filetime", "filetime"),
)
"""All registers of a channel, once a minute: energy, reactive energy by quadrants, demand."""

quarantine = sa.Table(
    "quarantine",
    metadata,
    sa.Column("id", _BIG, primary_key=True, autoincrement=True),
    sa.Column("received", _TIME, nullable=False),
    sa.Column("topic", sa.Text, nullable=False),
    sa.Column("payload", sa.LargeBinary, nullable=False),
    sa.Column("reason", sa.Text, nullable=False),
    sa.Column("sha256", sa.Text),
    sa.Index("quarantine_sha256", "sha256", unique=True),
)
"""Messages that are no new rows, and why; `sha256` is of topic, payload and reason."""


power_event = sa.Table(
    "power_event",
    metadata,
    sa.Column("device", sa.Text, nullable=False),
    sa.Column("boot", sa.Text, nullable=False),
    sa.Column("number", _BIG, nullable=False),
    sa.Column("kind", sa.Text, nullable=False),
    sa.Column("time", _TIME, nullable=False),
    sa.Column("filetime", _BIG, nullable=False),
    *(sa.Column(name, sa.Double) for name in ("duration", "extreme", "reference")),
    sa.Column("sliding", sa.Boolean, nullable=False),
    sa.Column("steady_change", sa.Double),
    sa.Column("phases", _JSON, nullable=False),
    sa.Column("flags", _JSON, nullable=False),
    sa.Column("waveform", sa.Text),
    sa.Column("schema", sa.SmallInteger, nullable=False),
    sa.PrimaryKeyConstraint("device", "boot", "number"),
    sa.Index("power_event_filetime", "filetime"),
)
"""Dips, swells, interruptions and rapid voltage changes; `duration` is null while an event goes on."""


def _rollup(name: str) -> sa.Table:
    return sa.Table(
        name,
        metadata,
        sa.Column("device", sa.Text, nullable=False),
        sa.Column("channel", sa.Text, nullable=False),
        sa.Column("start", _BIG, nullable=False),
        sa.Column("rows", sa.Integer, nullable=False),
        *(
            sa.Column(name, sa.Double)
            for name in ("Vrms", "Vrms_min", "Vrms_max", "Irms", "Irms_max", "P", "P_min", "P_max", "S", "PF", "f")
        ),
        sa.Column("W", sa.Double),
        sa.Column("flagged", sa.Integer, nullable=False),
        sa.PrimaryKeyConstraint("device", "channel", "start"),
    )


power_1min = _rollup("power_1min")
power_15min = _rollup("power_15min")
energy_quarter = sa.Table(
    "energy_quarter",
    metadata,
    sa.Column("device", sa.Text, nullable=False),
    sa.Column("start", _BIG, nullable=False),
    *(sa.Column(name, sa.Double) for name in ("kWh", "EUR", "missing_s")),
    sa.Column("tariff", sa.Text, nullable=False),
    sa.PrimaryKeyConstraint("device", "start"),
)
"""Energy and cost of every quarter hour with rows, by the tariff of then; where [energy] has a tariff."""

prediction_log = sa.Table(
    "prediction_log",
    metadata,
    sa.Column("sha256", sa.Text, primary_key=True),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("model", sa.Text, nullable=False),
    sa.Column("status", sa.Text, nullable=False),
    sa.Column("message", _JSON, nullable=False),
    sa.Column("published", sa.Boolean, nullable=False),
    sa.Column("done", _TIME, nullable=False),
)
"""Robot logs that the sidecar has worked through, by the hash of their content; `status` ok, refused or superseded."""

prediction = sa.Table(
    "prediction",
    metadata,
    sa.Column("sha256", sa.Text, nullable=False),
    sa.Column("filetime", _BIG, nullable=False),
    *(sa.Column(name, sa.Double) for name in ("P", "P_predicted", "residual")),
    sa.Column("device", sa.Text),
    sa.Column("time", _TIME),
    sa.PrimaryKeyConstraint("sha256", "filetime"),
    sa.Index("prediction_device_time", "device", "time"),
)
"""One row per 40 ms of a log: measured and predicted power, and their difference (W).

`device` is null in rows of earlier versions where the database has several devices. The views `v_prediction`,
`v_power_1min` and `v_power_15min` have a time stamp as the first column, for dashboards.
"""

sidecar_state = sa.Table(
    "sidecar_state",
    metadata,
    sa.Column("key", sa.Text, primary_key=True),
    sa.Column("value", _JSON, nullable=False),
)
"""What the sidecar remembers from log to log: clock lags, the sequential test."""

database_state = sa.Table(
    "database_state",
    metadata,
    sa.Column("key", sa.Text, primary_key=True),
    sa.Column("value", sa.Text, nullable=False),
)
"""What the sink remembers about the database: its identity, its last commits and maintenance (storage.state)."""

ROLLUPS = {60: power_1min, 900: power_15min}
"""Table by bucket length [s]. `start` is Unix seconds, W the reading at the end, `flagged` the rows with a flag."""
