"""`acqd close-loop`: residual, effect, better model."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer

from acqd.atomic import require_free
from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.progress import progress
from acqd.cli.terminal import terminal
from acqd.errors import UserError
from acqd.extras import LOOP, require
from acqd.report.digits import percent, year_text
from acqd.report.joint_names import all_with_joint_names, with_joint_names

_TIMES = ["%Y-%m-%dT%H:%M:%S", "%Y-%m-%dT%H:%M:%SZ", "%Y-%m-%d %H:%M:%S", "%Y-%m-%d"]


def close_loop(
    dataset: Annotated[
        Path, typer.Argument(metavar="DS", help="Folder of the dataset with the recordings in question.")
    ],
    model: Annotated[Path, typer.Option(help="Bundle of the model, from acqd train.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the report and the repaired model (default DS.loop).")
    ] = None,
    reference: Annotated[
        Path | None, typer.Option(help="Dataset to compare with (default: what the bundle remembers).")
    ] = None,
    further: Annotated[
        list[Path] | None,
        typer.Option("--with", metavar="DS", help="Dataset of a later session in question, too; may be repeated."),
    ] = None,
    max_effects: Annotated[int, typer.Option(min=1, max=24, help="Largest number of effects.")] = 5,
    only: Annotated[list[str] | None, typer.Option(help="Search only for this effect; may be repeated.")] = None,
    exclude: Annotated[list[str] | None, typer.Option(help="Do not search for this effect; may be repeated.")] = None,
    explain: Annotated[
        list[str] | None, typer.Option(help="Also print the way of this effect through the rules; may be repeated.")
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of a grey box that is fitted again; no verdict depends on it.")
    ] = 1,
    robot: Annotated[str | None, typer.Option(help="Robot description (default: the bundle's).")] = None,
    since: Annotated[
        datetime | None,
        typer.Option("--from", "--since", help="Leave out recordings that ended before (UTC).", formats=_TIMES),
    ] = None,
    tariff: Annotated[
        Path | None, typer.Option(help="TOML file with prices, for the cost of a cause (docs/energy.md).")
    ] = None,
    duty: Annotated[
        float | None,
        typer.Option(min=0, max=1, help="Share of the year in which the robot moves (default: as in the recordings)."),
    ] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Keep running, and judge new recordings of the dataset.")
    ] = False,
    every: Annotated[
        float | None, typer.Option(min=0.5, help="Seconds between looks (--watch, default 5).", show_default=False)
    ] = None,
    false_alarm: Annotated[
        float | None,
        typer.Option(min=1, help="Recorded hours per false alarm (--watch, default 200).", show_default=False),
    ] = None,
    json: Json = False,
) -> None:
    """Find the cause of a model's residual, add the cause to the model, report the error before and after.

    Example: acqd close-loop ds --model ds0.models/grey-box-everything-s1 [--watch]
    """
    require("acqd close-loop", LOOP, "loop")
    if watch and since is not None:
        raise UserError("--from is for a single run; --watch judges every recording that its model has not seen")
    if watch and further:
        raise UserError("--with is for a single run; --watch judges the recordings of one dataset as they come")
    if not watch and (every is not None or false_alarm is not None):
        raise UserError("--every and --false-alarm are for --watch")
    _require_known(explain or [])
    from acqd.dataset.places import default_folder
    from acqd.discrepancy.config import CloseConfig
    from acqd.discrepancy.loop import close_loop as run
    from acqd.discrepancy.report.belief import changed_belief
    from acqd.discrepancy.report.summary import as_json
    from acqd.discrepancy.report.way import way_of
    from acqd.discrepancy.report.write import write_all
    from acqd.energy.tariff import load_tariff
    from acqd.models.yearly import Duty

    folder = out or default_folder(dataset, "watch" if watch else "loop-with" if further else "loop")
    since_s = None if since is None else since.replace(tzinfo=UTC).timestamp()
    price = None if tariff is None else load_tariff(tariff).mean_price
    config = CloseConfig(
        dataset, model, folder, reference, max_effects, tuple(only or ()), tuple(exclude or ()), seed, robot, since_s,
        tuple(further or ()),
        Duty(duty, price),
    )  # fmt: skip
    if watch:
        from acqd.cli.watch_loop import watch_loop

        watch_loop(config, every or 5.0, 3600 * (false_alarm or 200.0), json=json)
        return
    require_free(folder, "report.json", "report")
    console = terminal(stderr=True)
    with progress(console) as show_step:
        closed = run(config, show_step)
        show_step("drawing", 0.9)
        write_all(config, closed)
    result = as_json(config, closed)
    changes = changed_belief(default_folder(dataset, "loop"), result) if further else []
    for note in [*(note for note in closed.notes if json or note not in closed.warnings), *changes]:
        console.print(f"acqd: {with_joint_names(note, result['joint_names'])}")
    joints = result["joint_names"]
    ways = {name: way_of(closed, name) for name in explain or ()}
    if json:
        more: dict[str, Any] = {"out": str(folder)} | ({"ways": ways} if ways else {})
        more |= {"changed_belief": changes} if changes else {}
        print(orjson.dumps(result | more, option=orjson.OPT_SERIALIZE_NUMPY).decode())
        return
    _print(all_with_joint_names(result, joints), folder)
    for name, lines in all_with_joint_names(ways, joints).items():
        console.print(f"{name}:")
        for line in lines:
            console.print(f"  {line}")


def _require_known(names: list[str]) -> None:
    from acqd.models.effects import library

    for name in names:
        if name not in library():
            raise UserError(f"--explain {name}: no such effect; the effects are {', '.join(library())}")


def _print(result: dict[str, Any], folder: Path) -> None:
    console = terminal(tables=True)
    before, after = result["before"], result["after"]
    label = "" if result["measured"] == "mains" else f" ({result['measured']} power)"
    console.print(f"{result['verdict']}{label}: held-out RMSE {before['rmse']:.2f} -> {after['rmse']:.2f} W")
    for warning in result["warnings"]:
        console.print(f"mind: {warning}")
    if result["effects"]:
        table = Table("effect", "where", "parameters", "confidence", "RMSE", "alternatives")
        for effect in result["effects"]:
            values = [
                f"{name} {p['value']:.3g} {p['unit']}"
                + (f" ({p['ci95'][0]:.3g} to {p['ci95'][1]:.3g})" if p["ci95"] else "")
                for name, p in effect["parameters"].items()
            ]
            alternatives = ", ".join(
                f"{r['name']} {percent(r['confidence'])}" for r in effect["rivals"] if r["confidence"] >= 0.005
            )
            cells = [effect["id"], effect["where"], "\n".join(values), percent(effect["confidence"])]
            table.add_row(*cells, f"-{effect['delta_rmse']:.2f} W", alternatives)
        console.print(table)
    if result["causes"]:
        console.print(result["causes"]["text"])
    if result["correction"]:
        console.print(f"correction: {_corrected_by(result['correction'])}")
    for effect in result["effects"]:
        if effect["a_year"] is not None:
            console.print(_a_year(effect))
    console.print(f"residual: {result['unexplained']}")
    for step in result["next"]:
        console.print(f"next: {step}")
    console.print(f"report: {folder / 'report.html'}")


def _corrected_by(correction: dict[str, Any]) -> str:
    size = correction["size"]
    interval = f" ({size['ci95'][0]:.3g} to {size['ci95'][1]:.3g})" if size["ci95"] else ""
    return f"{correction['follows']}: up to {size['value']:.3g} {size['unit']}{interval}; cause unknown"


def _a_year(effect: dict[str, Any]) -> str:
    year = effect["a_year"]
    return f"{effect['id']}: {year_text(year)} a year, moving {percent(year['duty'])} of the time"
