"""Rows of power quality, one per aggregation interval and channel."""

from typing import Any

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

_NUMBERS = (
    "f", "rocof", "Vrms", "Irms", "P", "S", "PF", "V1", "I1", "V1_angle", "I1_angle", "P1", "Q1", "S1", "DPF",
    "V_dc", "I_dc", "V_crest", "I_crest", "V_thds", "I_thds", "Se", "PFe", "V_12", "V_23", "V_31",
    "V_pos", "V_u2", "V_u0", "I_u2", "I_u0", "I_n_derived",
)  # fmt: skip


def upgrade() -> None:
    """Create the table."""
    postgres = op.get_bind().dialect.name == "postgresql"
    json: Any = postgresql.JSONB() if postgres else sa.JSON()
    time: Any = sa.DateTime(timezone=True) if postgres else sa.Text()
    big: Any = sa.BigInteger() if postgres else sa.Integer()
    op.create_table(
        "power_quality",
        *(sa.Column(name, sa.Text, nullable=False) for name in ("device", "channel", "boot")),
        sa.Column("seq", big, nullable=False),
        sa.Column("time", time, nullable=False),
        sa.Column("filetime", big, nullable=False),
        sa.Column("aggregation", sa.Text, nullable=False),
        sa.Column("duration", sa.Double),
        sa.Column("intervals", sa.Integer, nullable=False),
        sa.Column("flags", json, nullable=False),
        *(sa.Column(name, sa.Double) for name in _NUMBERS),
        sa.Column("rotation", sa.Text),
        *(sa.Column(name, json) for name in ("V_h", "I_h", "V_ih", "I_ih")),
        sa.Column("schema", sa.SmallInteger, nullable=False),
        sa.PrimaryKeyConstraint("device", "channel", "boot", "seq"),
    )
    op.create_index("power_quality_filetime", "power_quality", ["filetime"])


def downgrade() -> None:
    """Drop it."""
    op.drop_table("power_quality")
