"""Files of the other channels of one shot: some instruments write one channel a file."""

from __future__ import annotations

import re
from pathlib import Path

SAME_STEP = 1e-6
"""By how much the rates of files of one shot may differ, relative."""
_CHANNEL = re.compile(r"(?:(?<![a-zA-Z])[cC][hH]?|(?<=[a-z])CH?)([1-8])(?!\d)")
"""`C1--Trace--00000.trc`, `tek0001CH1.isf`, `pressCH1.wfm`; `batch1` names no channel."""
_ALIGNED = 0.01  # of a step: samples that are that near to each other are of the same times


def channel_number(path: Path) -> str:
    """Of the channel that the name of a file says; empty where it says none."""
    found = list(_CHANNEL.finditer(path.stem))
    return found[-1].group(1) if found else ""


def siblings(path: Path) -> list[Path]:
    """Files of the other channels of the same shot."""
    found = list(_CHANNEL.finditer(path.stem))
    if not found:
        return []
    letters, own = found[-1].span(1), found[-1].group(1)
    names = [
        f"{path.stem[: letters[0]]}{k}{path.stem[letters[1] :]}{path.suffix}" for k in range(1, 9) if str(k) != own
    ]
    return [path.with_name(name) for name in names if path.with_name(name).is_file()]


def skew(later_s: float, step_s: float) -> float:
    """Of a channel whose first sample is so much later than that of another one [s]; 0 for a rounding."""
    return later_s if abs(later_s) > _ALIGNED * step_s else 0.0
