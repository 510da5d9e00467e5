"""Table of voltage events."""

from typing import Any

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Create the table."""
    postgres = op.get_bind().dialect.name == "postgresql"
    json: Any = postgresql.JSONB() if postgres else sa.JSON()
    time: Any = sa.DateTime(timezone=True) if postgres else sa.Text()
    big: Any = sa.BigInteger() if postgres else sa.Integer()
    op.create_table(
        "power_event",
        *(sa.Column(name, sa.Text, nullable=False) for name in ("device", "boot")),
        sa.Column("number", big, nullable=False),
        sa.Column("kind", sa.Text, nullable=False),
        sa.Column("time", time, nullable=False),
        sa.Column("filetime", big, nullable=False),
        *(sa.Column(name, sa.Double) for name in ("duration", "extreme", "reference")),
        sa.Column("sliding", sa.Boolean, nullable=False),
        sa.Column("steady_change", sa.Double),
        sa.Column("phases", json, nullable=False),
        sa.Column("flags", json, nullable=False),
        sa.Column("waveform", sa.Text),
        sa.Column("schema", sa.SmallInteger, nullable=False),
        sa.PrimaryKeyConstraint("device", "boot", "number"),
    )
    op.create_index("power_event_filetime", "power_event", ["filetime"])


def downgrade() -> None:
    """Drop the table."""
    op.drop_table("power_event")
