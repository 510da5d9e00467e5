"""Predictions get `device` and `time` like rows of power, and views have a time column where tables have a number.

Dashboards select by time stamps: `v_prediction`, `v_power_1min` and `v_power_15min` are for them.
"""

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

_MICROSECONDS = '("filetime" - 116444736000000000) / 10'
"""Unix time of a FILETIME [us]."""
_TIME = {
    "postgresql": f"timestamptz 'epoch' + {_MICROSECONDS} * interval '1 microsecond'",
    "sqlite": f"strftime('%Y-%m-%dT%H:%M:%S', {_MICROSECONDS} / 1000000, 'unixepoch')"
    f" || printf('.%06dZ', {_MICROSECONDS} % 1000000)",
}
_START = {
    "postgresql": 'to_timestamp("start")',
    "sqlite": "strftime('%Y-%m-%dT%H:%M:%SZ', \"start\", 'unixepoch')",
}
_ROLLED_UP = ("Vrms", "Vrms_min", "Vrms_max", "Irms", "Irms_max", "P", "P_min", "P_max", "S", "PF", "f", "W")


def upgrade() -> None:
    """Add the columns, fill them for earlier rows, make the views."""
    kind = op.get_bind().dialect.name
    time: Any = sa.DateTime(timezone=True) if kind == "postgresql" else sa.Text()
    op.add_column("prediction", sa.Column("device", sa.Text, nullable=True))
    op.add_column("prediction", sa.Column("time", time, nullable=True))
    predictions = sa.table("prediction", sa.column("time"))
    op.execute(sa.update(predictions).values(time=sa.literal_column(_TIME[kind])))
    # A sidecar has one device. Where the rows of power are of several, nobody knows any more which one it was.
    op.execute(
        "UPDATE prediction SET device = (SELECT min(device) FROM power)"
        " WHERE (SELECT min(device) FROM power) = (SELECT max(device) FROM power)"
    )
    op.create_index("prediction_device_time", "prediction", ["device", "time"])
    op.execute(
        'CREATE VIEW v_prediction AS SELECT p."time", p.device, l.name AS log, l.model, p."P", p."P_predicted",'
        " p.residual FROM prediction p JOIN prediction_log l ON l.sha256 = p.sha256"
    )
    for name in ("power_1min", "power_15min"):
        columns: list[sa.ColumnClause[Any]] = [
            sa.column(each) for each in ("device", "channel", "start", *_ROLLED_UP, "rows", "flagged")
        ]
        query = sa.select(sa.literal_column(_START[kind]).label("time"), *columns).select_from(sa.table(name))
        op.execute(sa.text(f"CREATE VIEW v_{name} AS {query.compile(op.get_bind())}"))


def downgrade() -> None:
    """Remove views and columns."""
    for name in ("v_power_15min", "v_power_1min", "v_prediction"):
        op.execute(f"DROP VIEW {name}")
    op.drop_index("prediction_device_time", "prediction")
    for column in ("time", "device"):
        op.drop_column("prediction", column)
