"""A device of the plant: state, the gravest of what is wrong, its cause, energy and cost of a day."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from acqd.energy.account import Account, Period
from acqd.fleet import words
from acqd.plant.heard import Heard

Severity = Literal["alarm", "no rows", "changed", "acknowledged", "unknown", "fine"]
SEVERITIES: tuple[Severity, ...] = ("alarm", "no rows", "changed", "acknowledged", "unknown", "fine")
"""The gravest first; unknown: nobody was asked for alarms."""
_KNOWN = 0.99
"""Least share of a day with rows, for its energy to count as that of a day."""
DAYS = 14


@dataclass(frozen=True, slots=True)
class DeviceRow:
    """One row of the plant's page."""

    device: str
    state: str
    severity: Severity
    cause: str
    since: str
    """UTC to the minute, "before ..." or empty."""
    kWh: float | None
    """Of a day: the mean of the last seven that have rows for 99 % of their time."""
    EUR: float | None
    change: float | None
    """Relative, against the same weekdays of the week before."""
    days: tuple[float | None, ...]
    """kWh of the last 14 days; None: too few rows."""
    missing_s: float
    """Of the last seven days."""
    acknowledged_by: str
    report: str | None
    """Path of the closing report."""
    simulated: bool

    def as_json(self) -> dict[str, Any]:
        """For programs."""
        return {name: getattr(self, name) for name in self.__slots__}


def device_row(
    device: str, account: Account | None, heard: Heard | None, alarms: Sequence[Mapping[str, Any]],
    found: Mapping[str, Any] | None, *, earlier: bool = False, simulated: bool = False,
) -> DeviceRow:  # fmt: skip
    """`account`: of 14 days, one period each; None: no rows in that time. `alarms`: of this device and its daemon.

    `earlier`: whether there are rows before the last complete day, and none on it.
    """
    days = [] if account is None else account.periods
    usual = [_usual(one) for one in days]
    kWh = _mean([one.kWh for one in usual[7:] if one])
    EUR = _mean([_cost(one) for one in usual[7:] if one])
    state = _state(device, heard)
    silent = not days or days[-1].known_s == 0
    earlier = earlier or any(one.known_s > 0 for one in days)
    open_alarms = [each for each in alarms if not each.get("acknowledged_by")]
    changed = found is not None and found["state"] == "changed"
    severity: Severity = (
        "alarm" if open_alarms else "no rows" if silent and (earlier or state != "online")
        else "acknowledged" if alarms else "changed" if changed else "unknown" if heard is None else "fine"
    )  # fmt: skip
    named = [str(each.get("text", "")).removeprefix(f"{device}: ") for each in alarms]
    if found is not None and (changed or found["error"]):
        named.append(words.what(dict(found)))
    return DeviceRow(
        device, state, severity, "; ".join(filter(None, named)), _since(alarms, found), kWh, EUR,
        _change(usual), tuple(one.kWh if one else None for one in usual),
        sum(one.missing_s for one in days[7:]), ", ".join(sorted({str(each["acknowledged_by"]) for each in alarms
                                                                 if each.get("acknowledged_by")})),
        None if found is None else found["report"], simulated,
    )  # fmt: skip


def _change(usual: Sequence[Period | None]) -> float | None:
    """Of the days that are known in both weeks: other weekdays take another energy."""
    pairs = [(one.kWh, before.kWh) for one, before in zip(usual[7:], usual[:7], strict=False) if one and before]
    now, earlier = (sum(pair[k] or 0.0 for pair in pairs) for k in (0, 1))
    return now / earlier - 1 if earlier else None


def _usual(one: Period) -> Period | None:
    """The period where it tells what a day takes."""
    return one if one.kWh is not None and one.known_s >= _KNOWN * (one.end - one.begin) else None


def _cost(one: Period) -> float | None:
    return None if one.cost is None or one.unpriced_nWh else float(one.cost)


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def _state(device: str, heard: Heard | None) -> str:
    if heard is None:
        return "not asked"
    daemon = heard.daemon_of(device)
    if daemon is None:
        return "no daemon"
    if heard.daemons[daemon] is None:
        return "offline"
    return "in trouble" if heard.faults.get(daemon) else "online"


def _since(alarms: Sequence[Mapping[str, Any]], found: Mapping[str, Any] | None) -> str:
    times = sorted(str(each.get("since", ""))[:16].replace("T", " ") for each in alarms)
    if times:
        return times[0]
    return words.since(dict(found)) if found is not None else ""
