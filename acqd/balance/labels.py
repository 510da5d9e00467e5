"""Names of the spans to which rows belong, and their prices."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal, get_args
from zoneinfo import ZoneInfo

import numpy as np

from acqd.arrays import Floats
from acqd.balance.rows import Rows
from acqd.energy.periods import Range, boundaries, label
from acqd.energy.tariff import Tariff
from acqd.errors import UserError
from acqd.robot.log_layout import LABELS
from acqd.work.labels import names_of

By = Literal["recording", "hour", "day", "week", "month", "total"]
SPLITS: tuple[By, ...] = get_args(By)
_MINUTE_S, _QUARTER_S = 60, 900


def labels_of(rows: Rows, by: str, zone: ZoneInfo, path: Path) -> np.ndarray:
    """[T] name of the span of every row; `path`: of the dataset, for messages. Raises UserError."""
    if by in LABELS:
        return np.concatenate(names_of(rows.segments, by, path))
    split = next((each for each in SPLITS if each == by), None)
    if split is None:
        raise UserError(f"--by {by!r}: expected {', '.join((*SPLITS, *LABELS))}")
    if split == "total":
        return np.full(len(rows.time), "all")
    if split == "recording":
        return rows.recording
    first, last = float(rows.time.min()), float(rows.time.max())
    chosen = Range(math.floor(first / _MINUTE_S) * _MINUTE_S, (math.floor(last / _MINUTE_S) + 1) * _MINUTE_S)
    starts = np.array(boundaries(chosen, split, zone)[:-1])
    names = np.array([label(int(each), split, zone) for each in starts])
    return np.asarray(names[np.searchsorted(starts, rows.time, side="right") - 1])


def prices_of(rows: Rows, tariff: Tariff | None) -> Floats | None:
    """[T] EUR per kWh of every row; None without prices. Raises InputError outside of a price series."""
    if tariff is None or tariff.price is None:
        return None
    step = _MINUTE_S if tariff.by_minute else _QUARTER_S
    moments, which = np.unique((rows.time // step).astype(np.int64) * step, return_inverse=True)
    prices = tariff.prices(moments)
    assert prices is not None
    return np.array([float(each) for each in prices])[which]
