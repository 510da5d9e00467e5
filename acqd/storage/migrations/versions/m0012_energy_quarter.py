"""Energy and cost of quarter hours, for dashboards."""

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None

_START = {
    "postgresql": 'to_timestamp("start")',
    "sqlite": "strftime('%Y-%m-%dT%H:%M:%SZ', \"start\", 'unixepoch')",
}


def upgrade() -> None:
    """Create the table and its view."""
    kind = op.get_bind().dialect.name
    big: Any = sa.BigInteger() if kind == "postgresql" else sa.Integer()
    op.create_table(
        "energy_quarter",
        sa.Column("device", sa.Text, nullable=False),
        sa.Column("start", big, nullable=False),
        *(sa.Column(name, sa.Double) for name in ("kWh", "EUR", "missing_s")),
        sa.Column("tariff", sa.Text, nullable=False),
        sa.PrimaryKeyConstraint("device", "start"),
    )
    columns: list[sa.ColumnClause[Any]] = [
        sa.column(each) for each in ("device", "start", "kWh", "EUR", "missing_s", "tariff")
    ]
    query = sa.select(sa.literal_column(_START[kind]).label("time"), *columns).select_from(sa.table("energy_quarter"))
    op.execute(sa.text(f"CREATE VIEW v_energy_quarter AS {query.compile(op.get_bind())}"))


def downgrade() -> None:
    """Remove them."""
    op.execute("DROP VIEW v_energy_quarter")
    op.drop_table("energy_quarter")
