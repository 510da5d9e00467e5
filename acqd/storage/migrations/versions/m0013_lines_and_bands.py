"""Lines up to 100 Hz, bands from 2 to 9 kHz in the rows of power quality."""

from typing import Any

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None

_LISTS = ("V_lines", "I_lines", "V_bands", "I_bands", "V_bands_1k", "I_bands_1k")


def upgrade() -> None:
    """Add the columns."""
    json: Any = postgresql.JSONB() if op.get_bind().dialect.name == "postgresql" else sa.JSON()
    for name in _LISTS:
        op.add_column("power_quality", sa.Column(name, json))


def downgrade() -> None:
    """Remove them."""
    for name in _LISTS:
        op.drop_column("power_quality", name)
