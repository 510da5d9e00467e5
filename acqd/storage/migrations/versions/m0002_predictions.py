"""Tables of the sidecar: finished logs, predictions, and its state."""

from typing import Any

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Create the three tables."""
    postgres = op.get_bind().dialect.name == "postgresql"
    json: Any = postgresql.JSONB() if postgres else sa.JSON()
    time: Any = sa.DateTime(timezone=True) if postgres else sa.Text()
    big: Any = sa.BigInteger() if postgres else sa.Integer()
    op.create_table(
        "prediction_log",
        sa.Column("sha256", sa.Text, primary_key=True),
        *(sa.Column(name, sa.Text, nullable=False) for name in ("name", "model", "status")),
        sa.Column("message", json, nullable=False),
        sa.Column("published", sa.Boolean, nullable=False),
        sa.Column("done", time, nullable=False),
    )
    op.create_table(
        "prediction",
        sa.Column("sha256", sa.Text, nullable=False),
        sa.Column("filetime", big, nullable=False),
        *(sa.Column(name, sa.Double) for name in ("P", "P_predicted", "residual")),
        sa.PrimaryKeyConstraint("sha256", "filetime"),
    )
    op.create_table(
        "sidecar_state",
        sa.Column("key", sa.Text, primary_key=True),
        sa.Column("value", json, nullable=False),
    )
