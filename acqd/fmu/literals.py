"""Numbers as C."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from acqd.errors import UserError


def literal(values: Any) -> str:
    """A number or nested braces of numbers, with all their digits. Raises UserError for numbers that are not finite."""
    values = np.asarray(values)
    if values.ndim == 0:
        if not np.isfinite(values):
            raise UserError("the model holds numbers that are not finite; train it again")
        return repr(float(values))
    return "{" + ",".join(literal(each) for each in values) + "}"


@dataclass(slots=True)
class Header:
    """A C header in the making."""

    lines: list[str] = field(default_factory=list)

    def define(self, name: str, value: float | str) -> None:
        """A macro."""
        self.lines.append(f"#define {name} {value}")

    def array(self, name: str, values: Any) -> None:
        """A constant array of doubles. Raises UserError."""
        values = np.asarray(values, dtype=np.float64)
        extent = "".join(f"[{size}]" for size in values.shape)
        self.lines.append(f"static const double {name}{extent} = {literal(values)};")

    def text(self, guard: str) -> str:
        """The header with its include guard."""
        return "\n".join([f"#ifndef {guard}", f"#define {guard}", *self.lines, "#endif", ""])
