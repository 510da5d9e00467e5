"""One line of what `acqd doctor` reports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Finding:
    """What was looked at, how it is, and what to do about it."""

    check: str
    state: Literal["ok", "warn", "fail"]
    finding: str
    advice: str = ""
