"""What every cause costs in a year of the recorded work."""

from __future__ import annotations

from typing import Any

import numpy as np

from acqd.balance.rows import Rows
from acqd.models.effects.cause import Cause
from acqd.models.yearly import Duty, Yearly, yearly


def years_of(rows: Rows, duty: Duty) -> dict[Cause, Yearly]:
    """Energy and cost per year of every cause but stored energy, in their order."""
    names = list(dict.fromkeys(rows.recording.tolist()))
    places = [np.flatnonzero(rows.recording == name) for name in names]
    moving = [rows.moving[place] for place in places]
    years: dict[Cause, Yearly] = {}
    for cause in Cause:
        powers = [each.power for each in rows.parts if each.cause == cause]
        if powers and not cause.stored:
            whole = np.sum(powers, axis=0)
            years[cause] = yearly(names, [whole[place] for place in places], moving, duty)
    return years


def as_json(years: dict[Cause, Yearly]) -> dict[str, Any]:
    """For `--json`."""
    return {cause.value: each.as_json() for cause, each in years.items()}
