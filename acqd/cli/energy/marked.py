"""`acqd energy --by part --marks FILE`: energy by what a production system says a device was working on."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import orjson

from acqd.atomic import write_table
from acqd.cli.folded_table import Table
from acqd.cli.terminal import terminal
from acqd.errors import UserError

if TYPE_CHECKING:
    from sqlalchemy import Engine

    from acqd.energy.by_mark import ByMark
    from acqd.energy.marks import Marks
    from acqd.energy.periods import Range
    from acqd.energy.tariff import Tariff

Span = tuple[str | None, str | None, str | None, str | None]
_HEADER = ("device", "channel", "value", "visits", "seconds", "missing_s", "kWh", "EUR", "unpriced_kWh")


def marked(
    database: str, wanted: Sequence[str], by: str, path: Path, span: Span, rules: tuple[Path | None, str | None],
    table: Path | None, page: Path | None, *, json: bool,
) -> None:  # fmt: skip
    """Read, compute, print. Raises UserError."""
    from acqd.cli.energy.period import ranges
    from acqd.energy.marks import KINDS, read_marks
    from acqd.energy.periods import zone_of
    from acqd.energy.read import devices
    from acqd.energy.tariff import load_tariff
    from acqd.storage.database import read_database

    if by not in KINDS:
        raise UserError(f"--marks goes with --by {', '.join(KINDS)}, not with --by {by}")
    tariff = None if rules[0] is None else load_tariff(rules[0], rules[1])
    zone = zone_of(rules[1]) if rules[1] or tariff is None or tariff.zone is None else tariff.zone
    marks = read_marks(path, by)
    engine = read_database(database)
    wanted = wanted or (devices(engine) if "" in marks else [])
    if "" in marks and len(wanted) != 1:
        raise UserError(f"{path}: has no column device; say which one with --device")
    if lacking := [name for name in wanted if "" not in marks and name not in marks]:
        raise UserError(f"--device {lacking[0]!r}: {path} has lines of {', '.join(sorted(marks))}")
    chosen, _ = ranges(*span, zone)
    of_device = {name: marks.get(name) or marks[""] for name in wanted or sorted(marks)}
    found, without_rows = _by_device(engine, of_device, chosen, tariff, all_needed=bool(wanted) or len(marks) == 1)
    if table is not None:
        write_table(table, _csv(found))
    if page is not None:
        from acqd.energy.mark_page import mark_page

        mark_page(found, by, chosen, zone, without_rows).write(page)
    if json:
        files = {"csv": table and str(table), "html": page and str(page)}
        listed = [_json(one) for one in found]
        print(orjson.dumps({"by": by, "devices": listed, "without_rows": without_rows, **files}).decode())
        return
    for one in found:
        _print(one, by)
    for written in (table, page):
        if written is not None:
            print(f"written: {written}")


def _by_device(
    engine: Engine, marks: Mapping[str, Marks], chosen: Range, tariff: Tariff | None, *, all_needed: bool
) -> tuple[list[ByMark], list[str]]:
    """What devices used, and the devices without rows, which are named on stderr.

    A production system has marks of what nobody meters. Raises UserError where no device has rows.
    """
    from acqd.energy.by_mark import by_mark
    from acqd.energy.read import NoRowsError

    found, without_rows = [], []
    for name, of in marks.items():
        try:
            found.append(by_mark(engine, name, of, chosen.begin, chosen.end, tariff))
        except NoRowsError:
            if all_needed:
                raise
            without_rows.append(name)
    if not found:
        raise UserError(f"no device of the marks has rows in this period: {', '.join(without_rows)}")
    if without_rows:
        terminal(stderr=True).print(f"acqd: without rows in this period, left out: {', '.join(without_rows)}")
    return found, without_rows


def _json(one: ByMark) -> dict[str, Any]:
    values = [
        {"value": each.name or None, "visits": each.visits, "seconds": each.seconds,
         "missing_s": max(each.seconds - each.known_s, 0.0), "nWh": each.nWh, "kWh": each.kWh,
         "EUR": None if each.cost is None else float(each.cost), "unpriced_kWh": each.unpriced_nWh / 1e12}
        for each in one.values
    ]  # fmt: skip
    return {
        "device": one.device, "channel": one.channel, "values": values, "over_gaps_nWh": one.between_nWh,
        "register_set_nWh": one.jumps_nWh, "register_nWh": one.register_nWh, "rows": one.rows,
        "simulated": one.simulated,
    }  # fmt: skip


def _csv(found: Sequence[ByMark]) -> str:
    """A line a value; what belongs to none on lines of its own, so that a device adds up to its register."""
    from acqd.energy.tables import exact_kwh

    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerow(_HEADER)
    for one in found:
        for each in one.values:
            cost = "" if each.cost is None else f"{float(each.cost):.6f}"
            missing = round(max(each.seconds - each.known_s, 0.0), 3)
            out.writerow([one.device, one.channel, each.name, each.visits, round(each.seconds, 3), missing,
                          exact_kwh(each.nWh), cost, exact_kwh(each.unpriced_nWh)])  # fmt: skip
        for name, nWh in (("over gaps", one.between_nWh), ("register set", one.jumps_nWh)):
            if nWh:
                out.writerow([one.device, one.channel, name, "", "", "", exact_kwh(nWh), "", ""])
    return text.getvalue()


def _print(one: ByMark, by: str) -> None:
    from acqd.energy.mark_page import COLUMNS, cells

    origin = " (simulated)" if one.simulated else ""
    shown = Table(by, *COLUMNS, title=f"{one.device} {one.channel}{origin}", title_justify="left")
    for column in shown.columns[1:]:
        column.justify = "right"
    for each in one.values:
        shown.add_row(*cells(each))
    console = terminal(tables=True)
    console.print(shown)
    if one.between_nWh:
        kwh = one.between_nWh / 1e12
        console.print(f"{kwh:.6f} kWh were counted where rows lack, over the end of a visit: they belong to none")
    if one.jumps_nWh:
        console.print("note: the register was exchanged or set; those steps are no energy")
