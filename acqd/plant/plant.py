"""Reads what the plant's pages show."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from acqd.energy.account import Account
from acqd.energy.periods import days_before
from acqd.energy.read import devices, has_rows, is_simulated, read_accounts
from acqd.energy.rules import Rules
from acqd.errors import UserError
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
    loose: list[dict[str, Any]]
    """Alarms that belong to no row: of budgets, of daemons whose devices are not named, of devices without rows."""

    @property
    def open_loose(self) -> list[dict[str, Any]]:
        """Those that nobody has acknowledged."""
        return [alarm for alarm in self.loose if not alarm.get("acknowledged_by")]

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
    rows, trouble, attached = [], "", set(names)
    for k, name in enumerate(names):
        progress(f"{name}: energy", k / len(names))
        accounts, why = accounts_of(engine, name, [cuts], rules)
        trouble, account = trouble or why, accounts[0] if accounts else None
        daemon = heard.daemon_of(name) if heard is not None else None
        of_daemon = alarms.get(daemon, []) if daemon is not None and daemon not in names else []
        attached |= {daemon} if daemon is not None else set()
        earlier = account is None and not has_rows(engine, name, cuts[-2], end) and has_rows(engine, name, 0, end)
        own = [*alarms.get(name, []), *of_daemon]
        simulated = is_simulated(engine, name) if account is None else account.simulated
        rows.append(device_row(name, account, heard, own, found.get(name), earlier=earlier, simulated=simulated))
    rows.sort(key=lambda row: (SEVERITIES.index(row.severity), -(row.kWh or 0.0), row.device))
    loose = [alarm for key, of_key in alarms.items() if key not in attached for alarm in of_key]
    return Plant(rows, rules, end, heard, trouble, loose)


def accounts_of(
    engine: sa.Engine, device: str, spans: Sequence[Sequence[int]], rules: Rules
) -> tuple[list[Account], str]:
    """Accounts between boundaries, empty without rows; and why the first has no costs although there is a tariff."""
    try:
        accounts = read_accounts(engine, device, spans, rules.tariff)
    except UserError:
        return [], ""
    return accounts, accounts[0].trouble


def alarms_by_device(heard: Heard | None) -> dict[str, list[dict[str, Any]]]:
    """Active alarms by the first part of their key; without `acqd alarms`, what the states of daemons say is wrong."""
    by_device: dict[str, list[dict[str, Any]]] = {}
    if heard is None:
        return by_device
    if heard.alarms is None:
        for daemon, faults in heard.faults.items():
            by_device[daemon] = [{"key": f"{daemon}/{kind}", "text": text} for kind, text in faults.items()]
        return by_device
    for alarm in heard.alarms:
        by_device.setdefault(str(alarm.get("key", "")).partition("/")[0], []).append(alarm)
    return by_device
