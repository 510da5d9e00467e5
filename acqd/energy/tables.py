"""A statement as JSON and as CSV."""

from __future__ import annotations

import csv
import io
from datetime import datetime
from typing import Any

from acqd.energy.account import Account, Demand, Period
from acqd.energy.comparison import Comparison
from acqd.energy.statement import Statement
from acqd.energy.stretches import NWH_PER_KWH

_DIGITS = 12
_HEADER = (
    "device", "channel", "period", "begin", "end", "kWh", "missing_s", "mean_W", "max_W", "demand_W", "EUR", "CO2_kg",
    "standby_kWh", "unpriced_kWh", "without_CO2_kWh",
)  # fmt: skip


def exact_kwh(nWh: int) -> str:
    """Whole nWh as kWh with all twelve decimals."""
    whole, rest = divmod(abs(nWh), NWH_PER_KWH)
    return f"{'-' if nWh < 0 else ''}{whole}.{rest:0{_DIGITS}d}"


def as_csv(bill: Statement) -> str:
    """One line a period and device; energy over gaps and jumps of the register on lines without begin and end.

    The column kWh of a device adds up to its register's difference.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(_HEADER)
    for account in bill.accounts:
        for period in account.periods:
            table.writerow([account.device, account.channel, bill.label(period), *_cells(bill, period)])
        for name, nWh in (("over gaps", account.between_nWh), ("register set", account.jumps_nWh)):
            if nWh:
                table.writerow([account.device, account.channel, name, "", "", exact_kwh(nWh), *[""] * 9])
    return text.getvalue()


def _cells(bill: Statement, one: Period) -> list[object]:
    demand = None if one.demand is None else one.demand.W
    values: list[object] = [
        _moment(bill, one.begin), _moment(bill, one.end), None if one.nWh is None else exact_kwh(one.nWh),
        round(one.missing_s, 3), *(None if x is None else round(x, 3) for x in (one.mean_W, one.max_W, demand)),
        None if one.cost is None else f"{float(one.cost):.6f}",
        None if one.co2_kg is None else f"{float(one.co2_kg):.6f}",
        None if one.standby_nWh is None else exact_kwh(one.standby_nWh),
        None if one.cost is None else exact_kwh(one.unpriced_nWh),
        None if one.co2_kg is None else exact_kwh(one.no_co2_nWh),
    ]  # fmt: skip
    return ["" if value is None else value for value in values]


def as_json(bill: Statement) -> dict[str, Any]:
    """For `--json`. `nWh` (1e-12 kWh) is exact, kWh its nearest double."""
    before = bill.before
    return {
        "from": _moment(bill, bill.chosen.begin), "to": _moment(bill, bill.chosen.end), "by": bill.by,
        "zone": bill.zone.key, "tariff": None if bill.tariff is None else bill.tariff.name,
        "total": _period(bill, bill.total), "periods": [_period(bill, one) for one in bill.periods],
        "capacity_EUR": bill.capacity_EUR,
        "capacity_per": bill.tariff.capacity_per if bill.tariff and bill.tariff.capacity_price is not None else None,
        "before": _comparison(bill, before) if isinstance(before, Comparison) else None,
        "before_missing": None if isinstance(before, Comparison) else before,
        "devices": [_account(bill, account) for account in bill.accounts],
    }  # fmt: skip


def _account(bill: Statement, account: Account) -> dict[str, Any]:
    return {
        "device": account.device, "channel": account.channel, "register_nWh": account.register_nWh,
        "over_gaps_nWh": account.between_nWh, "register_set_nWh": account.jumps_nWh,
        "standby_W": None if account.standby is None else account.standby.W,
        "standby_bucket_s": None if account.standby is None else account.standby.bucket_s,
        "total": _period(bill, account.total), "periods": [_period(bill, one) for one in account.periods],
        "remarks": account.remarks, "simulated": account.simulated,
    }  # fmt: skip


def _period(bill: Statement, one: Period) -> dict[str, Any]:
    return {
        "period": bill.label(one), "begin": _moment(bill, one.begin), "end": _moment(bill, one.end),
        "nWh": one.nWh, "kWh": one.kWh, "missing_s": round(one.missing_s, 3), "mean_W": one.mean_W,
        "max_W": one.max_W, "demand": None if one.demand is None else _demand(bill, one.demand),
        "EUR": None if one.cost is None else float(one.cost),
        "unpriced_kWh": one.unpriced_nWh / NWH_PER_KWH,
        "CO2_kg": None if one.co2_kg is None else float(one.co2_kg),
        "without_CO2_kWh": one.no_co2_nWh / NWH_PER_KWH,
        "standby_kWh": None if one.standby_nWh is None else one.standby_nWh / NWH_PER_KWH,
        "standby_share": standby_share(one),
    }  # fmt: skip


def standby_share(one: Period) -> float | None:
    """Share of the energy at rest."""
    return None if one.standby_nWh is None or not one.nWh or one.nWh <= 0 else one.standby_nWh / one.nWh


def _demand(bill: Statement, demand: Demand) -> dict[str, Any]:
    return {"W": demand.W, "start": _moment(bill, demand.start), "incomplete": demand.incomplete}


def _comparison(bill: Statement, one: Comparison) -> dict[str, Any]:
    return {
        "quantity": one.quantity, "now": one.now, "before": one.before, "change": one.change,
        "from": _moment(bill, one.begin), "to": _moment(bill, one.end),
    }  # fmt: skip


def _moment(bill: Statement, at: int) -> str:
    return datetime.fromtimestamp(at, bill.zone).isoformat()
