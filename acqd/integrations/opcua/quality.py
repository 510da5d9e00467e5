"""Flags of a row as OPC UA status codes (OPC 10000-8, 6.3)."""

from __future__ import annotations

from collections.abc import Iterable

from asyncua import ua

STALE = ua.StatusCode(ua.StatusCodes.BadNoCommunication)
"""Rows have stopped, or the daemon is offline."""
ABSENT = ua.StatusCode(ua.StatusCodes.BadNoData)
"""The row has no such quantity."""
GOOD = ua.StatusCode(ua.StatusCodes.Good)
_WORST_FIRST = {
    "invalid": ua.StatusCodes.BadSensorFailure,
    "stale": ua.StatusCodes.UncertainLastUsableValue,
    "overrange": ua.StatusCodes.UncertainSensorNotAccurate,
    "sync_error": ua.StatusCodes.UncertainSensorNotAccurate,
    "test": ua.StatusCodes.UncertainSimulatedValue,
    "simulated": ua.StatusCodes.UncertainSimulatedValue,
    "gap": ua.StatusCodes.UncertainSubNormal,
    "start": ua.StatusCodes.UncertainSubNormal,
    "transient": ua.StatusCodes.UncertainSubNormal,
    "unsettled": ua.StatusCodes.UncertainSubNormal,
    "clock_step": ua.StatusCodes.UncertainSubNormal,
    "clock_unlocked": ua.StatusCodes.UncertainSubNormal,
}


def status_of(flags: Iterable[str]) -> ua.StatusCode:
    """The worst that a row's flags say of its values; flags that do not impair them (late, rms_meter) are good."""
    present = set(flags)
    code = next((code for flag, code in _WORST_FIRST.items() if flag in present), None)
    return GOOD if code is None else ua.StatusCode(code)
