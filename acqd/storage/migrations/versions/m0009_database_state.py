"""What the sink remembers in its database about the database itself."""

import uuid

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Create the table, and the row that names this database."""
    table = op.create_table(
        "database_state",
        sa.Column("key", sa.Text, primary_key=True),
        sa.Column("value", sa.Text, nullable=False),
    )
    op.bulk_insert(table, [{"key": "identity", "value": uuid.uuid4().hex}])


def downgrade() -> None:
    """Remove it."""
    op.drop_table("database_state")
