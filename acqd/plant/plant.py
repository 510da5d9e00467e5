"""Reads what the plant's pages show."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from acqd.energy.account import Account
from acqd.energy.periods import days_before
from acqd.energy.read import devices, read_accounts
from acqd.energy.rules import Rules
from acqd.errors import InputError, UserError
from acqd.plant.device_row import DAYS, SEVERITIES, DeviceRow, device_row
from acqd.plant.heard import Heard

Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Plant:
    """All devices, the gravest first."""

    rows: list[DeviceRow]
    rules: Rules
    end: int
    """Unix s: the last midnight."""
    heard: Heard | None
    """None: the broker was not asked."""
    trouble: str
    """Why there are no costs although there is a tariff."""

    @property
    def simulated(self) -> bool:
        """Whether any device is."""
        return any(row.simulated for row in self.rows)


def read_plant(
    engine: sa.Engine, rules: Rules, now: float, heard: Heard | None, found: Mapping[str, Mapping[str, Any]],
    progress: Progress,
) -> Plant:  # fmt: skip
    """The last 14 complete days of every device. Raises UserError where nothing is known of any device."""
    end = days_before(int(now), 0, rules.zone)
    cuts = [days_before(int(now), days, rules.zone) for days in range(DAYS, -1, -1)]
    alarms = alarms_by_device(heard)
    names = sorted({*devices(engine), *found})
    if not names:
        raise UserError("the database has no rows of power; `acqd sink` stores them")
    rows, trouble = [], ""
    for k, name in enumerate(names):
        progress(f"{name}: energy", k / len(names))
        accounts, why = accounts_of(engine, name, [cuts], rules)
        trouble, account = trouble or why, accounts[0] if accounts else None
        daemon = heard.daemon_of(name) if heard is not None else None
        of_daemon = alarms.get(daemon, []) if daemon not in (None, name) and daemon not in names else []
        rows.append(device_row(name, account, heard, [*alarms.get(name, []), *of_daemon], found.get(name)))
    rows.sort(key=lambda row: (SEVERITIES.index(row.severity), -(row.kWh or 0.0), row.device))
    return Plant(rows, rules, end, heard, trouble)


def accounts_of(
    engine: sa.Engine, device: str, spans: Sequence[Sequence[int]], rules: Rules
) -> tuple[list[Account], str]:
    """Accounts between boundaries, empty without rows; and why they have no costs although there is a tariff."""
    try:
        return read_accounts(engine, device, spans, rules.tariff), ""
    except InputError as error:
        return read_accounts(engine, device, spans, None), str(error)
    except UserError:
        return [], ""


def alarms_by_device(heard: Heard | None) -> dict[str | None, list[dict[str, Any]]]:
    """Active alarms by the first part of their key; without `acqd alarms`, what the states of daemons say is wrong."""
    by_device: dict[str | None, list[dict[str, Any]]] = {}
    if heard is None:
        return by_device
    if heard.alarms is None:
        for daemon, faults in heard.faults.items():
            by_device[daemon] = [{"key": f"{daemon}/{kind}", "text": text} for kind, text in faults.items()]
        return by_device
    for alarm in heard.alarms:
        by_device.setdefault(str(alarm.get("key", "")).partition("/")[0], []).append(alarm)
    return by_device
