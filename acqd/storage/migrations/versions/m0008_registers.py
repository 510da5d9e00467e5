"""Registers of energy, reactive energy and demand, once a minute."""

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None

_NUMBERS = (
    "W_import", "W_export", "W_reactive_I", "W_reactive_II", "W_reactive_III", "W_reactive_IV",
    "P_demand", "P_demand_max", "P_demand_max_start",
)  # fmt: skip


def upgrade() -> None:
    """Create the table."""
    postgres = op.get_bind().dialect.name == "postgresql"
    time: Any = sa.DateTime(timezone=True) if postgres else sa.Text()
    big: Any = sa.BigInteger() if postgres else sa.Integer()
    op.create_table(
        "power_register",
        *(sa.Column(name, sa.Text, nullable=False) for name in ("device", "channel", "boot")),
        sa.Column("seq", big, nullable=False),
        sa.Column("time", time, nullable=False),
        sa.Column("filetime", big, nullable=False),
        *(sa.Column(name, sa.Double) for name in _NUMBERS),
        sa.Column("schema", sa.SmallInteger, nullable=False),
        sa.PrimaryKeyConstraint("device", "channel", "boot", "seq"),
    )
    op.create_index("power_register_filetime", "power_register", ["filetime"])


def downgrade() -> None:
    """Remove it."""
    op.drop_index("power_register_filetime", "power_register")
    op.drop_table("power_register")
