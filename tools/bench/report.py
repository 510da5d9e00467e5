"""Measured figures and their targets."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass

from rich.table import Table

from tools.common.tables import verdict


@dataclass(frozen=True, slots=True)
class Figure:
    """A line of the report. `target` is like "<= 0.02" or ">= 10"; empty: for information only."""

    section: str
    name: str
    value: float
    unit: str
    target: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None without one."""
        if not self.target:
            return None
        sign, _, limit = self.target.partition(" ")
        compare: Callable[[float, float], bool] = {"<=": operator.le, ">=": operator.ge}[sign]
        return bool(compare(self.value, float(limit)))


def table(figures: list[Figure], title: str = "make bench") -> Table:
    """The table of all figures."""
    shown = Table("what", "measured", "unit", "target", "", title=title, title_justify="left")
    section = ""
    for figure in figures:
        if figure.section != section:
            section = figure.section
            shown.add_section()
            shown.add_row(f"[bold]{section}[/]")
        met = verdict(figure.met, "met", "MISSED")
        shown.add_row(f"  {figure.name}", f"{figure.value:.4g}", figure.unit, figure.target, met)
    return shown
