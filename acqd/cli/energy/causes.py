"""`acqd energy causes`: the predicted power of recorded motion by cause."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer

from acqd.atomic import write_table
from acqd.cli.energy.outputs import check_outputs
from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.extras import require

if TYPE_CHECKING:
    from acqd.balance.balance import Balance
    from acqd.models.effects.cause import Cause
    from acqd.models.yearly import Yearly

DUTY = "Share of the year in which the robot moves, 0 to 1 (default: as in the recordings)."


def causes(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="Bundle of a grey box, also with added effects.")],
    dataset: Annotated[Path, typer.Argument(metavar="DS", help="Folder of a dataset of the same robot.")],
    by: Annotated[
        str, typer.Option(help="recording, hour, day, week, month, total, program, step, part or state.")
    ] = "recording",
    tariff: Annotated[Path | None, typer.Option(help="TOML file with prices (docs/energy.md).")] = None,
    zone: Annotated[
        str | None, typer.Option(help="Zone of local time (default: the tariff's, this computer's).")
    ] = None,
    duty: Annotated[float | None, typer.Option(min=0, max=1, help=DUTY)] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV file with every part by joint.")] = None,
    html: Annotated[Path | None, typer.Option(help="HTML report with pictures.")] = None,
    json: Json = False,
) -> None:
    """What the power of recorded motion is spent on: standby, potential and kinetic energy, friction, copper and more.

    Example: acqd energy causes ds.models/grey-box-everything-s1 ds --tariff tariff.toml --html causes.html
    """
    check_outputs("acqd energy causes", csv, html)
    require("acqd energy causes", ("safetensors", "scipy"), "data,predict")
    from acqd.balance.balance import balance_of
    from acqd.balance.labels import labels_of, prices_of
    from acqd.balance.rows import require_energy, rows_of
    from acqd.balance.tables import as_csv, as_json
    from acqd.balance.years import as_json as years_json
    from acqd.balance.years import years_of
    from acqd.energy.periods import zone_of
    from acqd.energy.tariff import load_tariff
    from acqd.models.bundle.restore import open_model
    from acqd.models.segments import load_dataset
    from acqd.models.yearly import Duty, require_duty

    given = None if tariff is None else load_tariff(tariff, zone)
    local = zone_of(zone) if zone or given is None or given.zone is None else given.zone
    bundle, opened = open_model(model)
    data = load_dataset(dataset)
    rows = rows_of(opened, bundle, model, data)
    require_energy(rows, dataset)
    work = Duty(duty, None if given is None else given.mean_price)
    require_duty(work, [rows.moving], dataset)
    balance = balance_of(rows, by, labels_of(rows, by, local, dataset), prices_of(rows, given))
    years = years_of(rows, work)
    if csv is not None:
        write_table(csv, as_csv(balance))
    if html is not None:
        from acqd.balance.page import balance_page
        from acqd.report.chain import REPORT, connect
        from acqd.robot.description import load_description

        joints = load_description(bundle.metadata["description"]).joint_names
        page = balance_page(f"{bundle.metadata['robot']}, {dataset.name}", balance, rows, years, data.measured, joints)
        page.detail("model", model)
        page.detail("dataset", dataset)
        page.detail("dataset SHA-256", data.digest)
        page.write(html)
        connect(html, [dataset / REPORT, model.parent / REPORT])
    if json:
        about = {"model": str(model), "dataset": str(dataset), "measured": data.measured}
        files = {"csv": csv and str(csv), "html": html and str(html)}
        print(orjson.dumps(about | as_json(balance) | {"years": years_json(years)} | files).decode())
        return
    _print(balance, years, data.measured)
    for written in (csv, html):
        if written is not None:
            print(f"written: {written}")


def _print(balance: Balance, years: dict[Cause, Yearly], measured: str) -> None:
    from acqd.balance.page import residual_text, share_text, year_texts
    from acqd.report.digits import percent, quantity

    total = balance.total
    title = (
        f"{quantity(1000 * total.measured, 'Wh', 4)} measured{'' if measured == 'mains' else f' ({measured} power)'}"
    )
    table = Table("cause", "energy", "share", "mean", "a year", "95 %", "cost", title=title, title_justify="left")
    for column in table.columns[1:]:
        column.justify = "right"
    for cause, kwh in total.by_cause().items():
        table.add_row(
            cause.value, quantity(1000 * kwh, "Wh", 3), share_text(kwh, total),
            quantity(3.6e6 * kwh / total.seconds, "W", 3), *year_texts(years.get(cause)),
        )  # fmt: skip
    console = terminal(tables=True)
    console.print(table)
    console.print(f"residual, measured minus predicted: {residual_text(total)}")
    for each in total.entries:
        if each.added:
            console.print(f"effect {each.name}: {quantity(1000 * each.kWh, 'Wh', 3)}, among {each.cause.value}")
    moving = percent(next(iter(years.values())).duty)
    console.print(f"a year at this work, moving {moving} of the time; --by, --csv and --json have the parts and joints")
