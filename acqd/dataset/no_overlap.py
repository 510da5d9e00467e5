"""Why no log has power, or power of another time: whose times are of which days, and what their distance suggests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acqd.dataset.power import PowerStream
from acqd.robot.log import DAY_S, RobotLog
from acqd.robot.log_times import LATEST_S
from acqd.timestamps import SINCE_1970_S, rfc3339

_EPOCHS_S = {
    "1904-01-01 (LabVIEW)": 2_082_844_800.0,
    "1900-01-01 (NTP)": 2_208_988_800.0,
    "1980-01-06 (GPS)": -315_964_800.0,
    "2001-01-01 (Apple)": -978_307_200.0,
}
"""What a clock counts seconds from, by how far it is ahead of Unix time."""
_FURTHEST_ZONE_H = 14
_NEAR_S, _QUARTER_S = 120.0, 900.0
"""Clocks that people set differ by less than the first; time zones differ by multiples of the second."""
_Span = tuple[float, float]


def no_overlap(powers: Sequence[PowerStream], logs: Sequence[RobotLog]) -> str:
    """The line on logs of which none has power."""
    power = _span([each.time_ns * 1e-9 for each in powers])
    motion = _span([each.time for each in logs])
    if power is None or motion is None:
        return "no log overlaps the power stream: are they of the same days?"
    spans = f"power of {_text(power)}, logs of {_text(motion)}"
    return f"no log overlaps the power stream: {spans}; {_remedy(power, motion)}"


def far_apart(lags_s: Sequence[float], powers: Sequence[PowerStream], logs: Sequence[RobotLog]) -> list[str]:
    """A line where logs were placed in power of another time: clocks of two zones, or power of another run.

    `lags_s`: controller clock minus power clock, of each log that has a place.
    """
    power, motion = _span([each.time_ns * 1e-9 for each in powers]), _span([each.time for each in logs])
    lag_s = float(np.median(lags_s)) if len(lags_s) else 0.0
    if power is None or motion is None or min(power[0], motion[0]) < SINCE_1970_S or abs(lag_s) <= _NEAR_S:
        return []
    ahead, behind = ("logs'", "meter's") if lag_s > 0 else ("meter's", "logs'")
    quarters = abs(lag_s) / _QUARTER_S
    of_zone = round(quarters) > 0 and abs(quarters - round(quarters)) * _QUARTER_S <= _NEAR_S
    if of_zone and quarters <= 4 * _FURTHEST_ZONE_H + 1:
        return [
            f"the {ahead} clock is {round(quarters) / 4:g} h ahead of the {behind}, as clocks of two time zones are, "
            "or of summer and winter time; the shift is taken out"
        ]
    side = "before" if lag_s > 0 else "after"
    amount = f"{abs(lag_s) / DAY_S:.1f} days" if abs(lag_s) > 2 * DAY_S else f"{abs(lag_s) / 60:.0f} min"
    return [
        f"the power that fits was metered {amount} {side} the logs, by the times of both: "
        "is one of the clocks wrong, or is it power of another run of the same program?"
    ]


def _span(times: Sequence[np.ndarray]) -> _Span | None:
    known = [each[np.isfinite(each)] for each in times]
    known = [each for each in known if len(each)]
    return (min(float(each.min()) for each in known), max(float(each.max()) for each in known)) if known else None


def _text(span: _Span) -> str:
    if span[0] < 0 or not SINCE_1970_S <= span[1] < LATEST_S:
        return f"{span[0]:.0f} to {span[1]:.0f} s"
    first, last = (f"{rfc3339(round(each) * 1_000_000_000)[:19]}Z" for each in span)
    return f"{first} to {last}"


def _remedy(power: _Span, motion: _Span) -> str:
    apart_s = sum(power) / 2 - sum(motion) / 2
    for ahead, first in ((apart_s, "the power's"), (-apart_s, "the logs'")):
        for epoch, by_s in _EPOCHS_S.items():
            if abs(ahead - by_s) < DAY_S:
                return f"are {first} times counted from {epoch}? Write Unix seconds, or dates"
    if _meet(power, motion, 0.0):
        return "has the stream a gap at the times of the logs?"
    if any(_meet(power, motion, 3600.0 * hour) for hour in range(-_FURTHEST_ZONE_H, _FURTHEST_ZONE_H + 1)):
        return "are they of two time zones? --zone says whose clock times without a zone are"
    return "are they of the same days? --search SECONDS widens the search"


def _meet(power: _Span, motion: _Span, by_s: float) -> bool:
    return power[0] < motion[1] + by_s and motion[0] + by_s < power[1]
