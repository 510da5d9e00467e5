"""A statement as JSON and as CSV."""

from __future__ import annotations

import csv
import io
from datetime import datetime
from typing import Any

from acqd.energy.account import Account, Demand, Period
from acqd.energy.statement import Comparison, Statement
from acqd.energy.stretches import NWH_PER_KWH

_DIGITS = 12
_HEADER = (
    "device", "channel", "period", "begin", "end", "kWh", "missing_s", "mean_W", "max_W", "demand_W", "EUR", "CO2_kg",
    "standby_kWh",
)  # fmt: skip


def exact_kwh(nWh: int) -> str:
    """Whole nWh as kWh with all twelve decimals."""
    whole, rest = divmod(abs(nWh), NWH_PER_KWH)
    return f"{'-' if nWh < 0 else ''}{whole}.{rest:0{_DIGITS}d}"


def as_csv(told: Statement) -> str:
    """One line a period and device; energy over gaps and jumps of the register on lines without begin and end.

    The column kWh of a device adds up to its register's difference.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(_HEADER)
    for account in told.accounts:
        for period in account.periods:
            table.writerow([account.device, account.channel, told.label(period), *_cells(told, period)])
        for name, nWh in (("over gaps", account.between_nWh), ("register set", account.jumps_nWh)):
            if nWh:
                table.writerow([account.device, account.channel, name, "", "", exact_kwh(nWh), *[""] * 7])
    return text.getvalue()


def _cells(told: Statement, one: Period) -> list[object]:
    demand = None if one.demand is None else one.demand.W
    values: list[object] = [
        _moment(told, one.begin), _moment(told, one.end), None if one.nWh is None else exact_kwh(one.nWh),
        round(one.missing_s, 3), *(None if x is None else round(x, 3) for x in (one.mean_W, one.max_W, demand)),
        None if one.cost is None else f"{float(one.cost):.6f}",
        None if one.co2_kg is None else f"{float(one.co2_kg):.6f}",
        None if one.standby_nWh is None else exact_kwh(one.standby_nWh),
    ]  # fmt: skip
    return ["" if value is None else value for value in values]


def as_json(told: Statement) -> dict[str, Any]:
    """For `--json`. `nWh` (1e-12 kWh) is exact, kWh its nearest double."""
    before = told.before
    return {
        "from": _moment(told, told.chosen.begin), "to": _moment(told, told.chosen.end), "by": told.by,
        "zone": told.zone.key, "tariff": None if told.tariff is None else told.tariff.name,
        "total": _period(told, told.total), "periods": [_period(told, one) for one in told.periods],
        "capacity_EUR": told.capacity_EUR,
        "capacity_per": told.tariff.capacity_per if told.tariff and told.tariff.capacity_price is not None else None,
        "before": _comparison(told, before) if isinstance(before, Comparison) else None,
        "before_missing": None if isinstance(before, Comparison) else before,
        "devices": [_account(told, account) for account in told.accounts],
    }  # fmt: skip


def _account(told: Statement, account: Account) -> dict[str, Any]:
    return {
        "device": account.device, "channel": account.channel, "register_nWh": account.register_nWh,
        "over_gaps_nWh": account.between_nWh, "register_set_nWh": account.jumps_nWh,
        "standby_W": None if account.standby is None else account.standby.W,
        "standby_bucket_s": None if account.standby is None else account.standby.bucket_s,
        "total": _period(told, account.total), "periods": [_period(told, one) for one in account.periods],
        "remarks": account.remarks, "simulated": account.simulated,
    }  # fmt: skip


def _period(told: Statement, one: Period) -> dict[str, Any]:
    return {
        "period": told.label(one), "begin": _moment(told, one.begin), "end": _moment(told, one.end),
        "nWh": one.nWh, "kWh": one.kWh, "missing_s": round(one.missing_s, 3), "mean_W": one.mean_W,
        "max_W": one.max_W, "demand": None if one.demand is None else _demand(told, one.demand),
        "EUR": None if one.cost is None else float(one.cost),
        "unpriced_kWh": one.unpriced_nWh / NWH_PER_KWH if one.unpriced_nWh else 0.0,
        "CO2_kg": None if one.co2_kg is None else float(one.co2_kg),
        "standby_kWh": None if one.standby_nWh is None else one.standby_nWh / NWH_PER_KWH,
        "standby_share": standby_share(one),
    }  # fmt: skip


def standby_share(one: Period) -> float | None:
    """Share of the energy at rest."""
    return None if one.standby_nWh is None or not one.nWh or one.nWh <= 0 else one.standby_nWh / one.nWh


def _demand(told: Statement, demand: Demand) -> dict[str, Any]:
    return {"W": demand.W, "start": _moment(told, demand.start), "incomplete": demand.incomplete}


def _comparison(told: Statement, one: Comparison) -> dict[str, Any]:
    return {
        "quantity": one.quantity, "now": one.now, "before": one.before, "change": one.change,
        "from": _moment(told, one.begin), "to": _moment(told, one.end),
    }  # fmt: skip


def _moment(told: Statement, at: int) -> str:
    return datetime.fromtimestamp(at, told.zone).isoformat()
