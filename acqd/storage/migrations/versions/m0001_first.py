"""First schema: power, quarantine and the two roll-ups.

Written out, not taken from schema.py: a migration must keep meaning what it meant. Where the
TimescaleDB extension is installed, `power` becomes a hypertable; its key then also names `time`,
which (boot, seq) determines, so idempotence is the same.
"""

from typing import Any

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

_CHUNK = 7 * 24 * 3600


def upgrade() -> None:
    """Create everything."""
    bind = op.get_bind()
    postgres = bind.dialect.name == "postgresql"
    json: Any = postgresql.JSONB() if postgres else sa.JSON()
    time: Any = sa.DateTime(timezone=True) if postgres else sa.Text()
    big: Any = sa.BigInteger() if postgres else sa.Integer()
    timescale = postgres and bool(
        bind.execute(sa.text("SELECT 1 FROM pg_extension WHERE extname = 'timescaledb'")).scalar()
    )
    key = ("device", "channel", "boot", "seq", *(("time",) if timescale else ()))
    op.create_table(
        "power",
        *(sa.Column(name, sa.Text, nullable=False) for name in ("device", "channel", "boot")),
        sa.Column("seq", big, nullable=False),
        sa.Column("time", time, nullable=False),
        sa.Column("filetime", big, nullable=False),
        *(sa.Column(name, sa.Double) for name in ("Vrms", "Irms", "P", "S", "PF", "f", "W")),
        sa.Column("flags", json, nullable=False),
        sa.Column("schema", sa.SmallInteger, nullable=False),
        sa.PrimaryKeyConstraint(*key),
    )
    if timescale:
        op.execute(f"SELECT create_hypertable('power', 'time', chunk_time_interval => INTERVAL '{_CHUNK} seconds')")
    else:
        op.create_index("power_filetime", "power", ["filetime"])
    op.create_table(
        "quarantine",
        sa.Column("id", big, primary_key=True, autoincrement=True),
        sa.Column("received", time, nullable=False),
        sa.Column("topic", sa.Text, nullable=False),
        sa.Column("payload", sa.LargeBinary, nullable=False),
        sa.Column("reason", sa.Text, nullable=False),
    )
    for name in ("power_1min", "power_15min"):
        op.create_table(
            name,
            sa.Column("device", sa.Text, nullable=False),
            sa.Column("channel", sa.Text, nullable=False),
            sa.Column("start", big, nullable=False),
            sa.Column("rows", sa.Integer, nullable=False),
            *(sa.Column(column, sa.Double) for column in ("Vrms", "Vrms_min", "Vrms_max", "Irms", "Irms_max")),
            *(sa.Column(column, sa.Double) for column in ("P", "P_min", "P_max", "S", "PF", "f", "W")),
            sa.Column("flagged", sa.Integer, nullable=False),
            sa.PrimaryKeyConstraint("device", "channel", "start"),
        )


def downgrade() -> None:
    """Drop everything."""
    for name in ("power_15min", "power_1min", "quarantine", "power"):
        op.drop_table(name)
