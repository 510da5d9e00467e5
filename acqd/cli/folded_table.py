"""Tables whose long cells are folded: a name of a file or a number that is cut is of no use."""

from __future__ import annotations

from typing import Any

import rich.table


class Table(rich.table.Table):
    """As Rich's, which cuts words that are too long."""

    def add_column(self, *arguments: Any, **options: Any) -> None:
        """As Rich's."""
        super().add_column(*arguments, **{"overflow": "fold"} | options)
