"""Under- and overdeviation of the voltage, angles and powers of harmonics in the rows of power quality."""

from typing import Any

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None

_NUMBERS, _LISTS = ("V_under", "V_over"), ("V_h_angle", "I_h_angle", "P_h")


def upgrade() -> None:
    """Add the columns."""
    json: Any = postgresql.JSONB() if op.get_bind().dialect.name == "postgresql" else sa.JSON()
    for name in _NUMBERS:
        op.add_column("power_quality", sa.Column(name, sa.Double))
    for name in _LISTS:
        op.add_column("power_quality", sa.Column(name, json))


def downgrade() -> None:
    """Remove them."""
    for name in (*_LISTS, *_NUMBERS):
        op.drop_column("power_quality", name)
