"""A message goes into quarantine once, however often it is delivered: key by the hash of topic, payload and reason."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the hash; earlier entries have none."""
    op.add_column("quarantine", sa.Column("sha256", sa.Text, nullable=True))
    op.create_index("quarantine_sha256", "quarantine", ["sha256"], unique=True)


def downgrade() -> None:
    """Remove the hash."""
    op.drop_index("quarantine_sha256", "quarantine")
    op.drop_column("quarantine", "sha256")
