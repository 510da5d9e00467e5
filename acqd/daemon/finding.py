"""One line of the report of `acqd doctor`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Finding:
    """What was checked, its state, and what to do about it."""

    check: str
    state: Literal["ok", "warn", "fail"]
    finding: str
    advice: str = ""
