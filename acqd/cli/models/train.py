"""`acqd train`: a model, or all of Table 7.1."""

from __future__ import annotations

import os
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

from acqd.cli.models.places import default_models
from acqd.cli.options import Json
from acqd.errors import UserError


class Engine(StrEnum):
    """Where several trainings run."""

    PROCESS = "process"
    RAY = "ray"


class Compute(StrEnum):
    """What computes gradients."""

    AUTO = "auto"
    FUSED = "fused"
    TORCH = "torch"


class Normal(StrEnum):
    """Normalisation."""

    FITTED = "fitted"
    THESIS = "thesis"


def train(
    dataset: Annotated[Path, typer.Argument(metavar="DS", help="Folder of a dataset.")],
    network: Annotated[
        str | None,
        typer.Option(
            help="7x1dim, 14x1dim, 21x1dim, 2conv1x3, 3conv1x3, 3conv1x5, 3conv1x11, 5conv1x21, grey-box or hybrid."
        ),
    ] = None,
    table_7_1: Annotated[bool, typer.Option("--table-7-1", help="The thesis' 14 combinations.")] = False,
    on: Annotated[list[str] | None, typer.Option(help="Kind of trajectories to train on (default all).")] = None,
    models: Annotated[Path | None, typer.Option(help="Folder for bundles (default DS.models).")] = None,
    out: Annotated[Path | None, typer.Option(help="The bundle's own folder, instead.")] = None,
    seed: Annotated[list[int] | None, typer.Option(help="May be given several times (default 1).")] = None,
    epochs: Annotated[int, typer.Option(min=1, help="Over all training recordings.")] = 2000,
    batch: Annotated[int, typer.Option(min=1, help="Sequences per optimiser step.")] = 11,
    rate: Annotated[float, typer.Option(min=1e-6, max=1, help="Learning rate, times 0.9 every 100 epochs.")] = 0.02,
    patience: Annotated[
        int | None, typer.Option(min=1, help="Looks at validation without gain before it stops.")
    ] = None,
    normalisation: Annotated[Normal, typer.Option(help="Fitted, or the thesis' constants.")] = Normal.FITTED,
    robot: Annotated[
        str | None, typer.Option(help="Description for grey-box and hybrid (default the dataset's).")
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            help="Denied to a grey box for a trial: copper_loss, coulomb_friction, viscous_friction, mechanical_power."
        ),
    ] = None,
    compute: Annotated[Compute, typer.Option(help="Fused C (needs a compiler) or torch.")] = Compute.AUTO,
    device: Annotated[str, typer.Option(help="cpu or cuda; of torch.")] = "cpu",
    jobs: Annotated[int | None, typer.Option(min=1, help="Trainings at a time (default one per core).")] = None,
    engine: Annotated[Engine, typer.Option(help="Processes here, or a Ray cluster.")] = Engine.PROCESS,
    ray_address: Annotated[str | None, typer.Option(help="Of the Ray cluster; without, one is started.")] = None,
    json: Json = False,
) -> None:
    """Train models of power; what was interrupted goes on where it stood.

    Examples: acqd train ds --network grey-box

    acqd train ds --network 21x1dim --seed 1 --seed 2

    acqd train ds --table-7-1
    """
    missing = [name for name in ("pyarrow", "scipy", "safetensors") if find_spec(name) is None]
    if missing:
        raise UserError(f"acqd train needs {' and '.join(missing)}: install acqd[model]")
    if (network is None) != table_7_1:
        raise UserError("name one --network, or ask for --table-7-1")
    from acqd.models.greybox.parameters import DENIABLE

    if without and (network != "grey-box" or not set(without) <= set(DENIABLE)):
        raise UserError(f"--without is for --network grey-box and takes {', '.join(DENIABLE)}")
    if out is not None and (table_7_1 or len(seed or []) > 1):
        raise UserError("--out is one bundle's folder; several models go into --models")
    from acqd.models.config import TrainConfig
    from acqd.models.networks.settings import TrainingSettings
    from acqd.models.protocol import orders
    from acqd.models.training import bundle_name

    settings = TrainingSettings(
        epochs=epochs,
        batch=batch,
        rate=rate,
        patience=patience,
        normalisation=normalisation.value,
        compute=compute.value,
        device=device,
    )
    folder = models or default_models(dataset)
    wanted: list[TrainConfig] = []
    for each in seed or [1]:
        template = TrainConfig(dataset, network or "", Path(), tuple(on or ()), each, settings, robot)
        if table_7_1:
            wanted += orders(template, folder)
        else:
            path = out or folder / bundle_name(template.network, template.kinds, each)
            denied = tuple(group for effect in without or () for group in DENIABLE[effect])
            wanted.append(TrainConfig(dataset, template.network, path, template.kinds, each, settings, robot, denied))
    console = Console(stderr=True)
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[left]}"),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    with bar:
        results = _one(wanted[0], bar) if len(wanted) == 1 else _many(wanted, bar, jobs, engine, ray_address)
    if json:
        print(orjson.dumps([{"bundle": str(o.out)} | _short(r) for o, r in results]).decode())
        return
    table = Table("bundle", "MAE train \\[W]", "validation", "test", "RMSE test", "energy p95 test", "seconds")
    for order, about in results:
        m = about["metrics"]
        cells = [f"{m[part]['mae']:.2f}" for part in ("train", "validation", "test")]
        table.add_row(
            str(order.out),
            *cells,
            f"{m['test']['rmse']:.2f}",
            f"{100 * m['test']['energy_p95']:.2f} %",
            f"{about['training']['seconds']:.0f}",
        )
    wide = Console(soft_wrap=True)
    wide.width = max(wide.width, 120)
    wide.print(table)


def _short(about: dict[str, Any]) -> dict[str, Any]:
    return {key: about[key] for key in ("name", "metrics", "training")}


def _one(order: Any, bar: Progress) -> list[tuple[Any, dict[str, Any]]]:
    from acqd.models.training import train_one

    task = bar.add_task(order.network, total=1.0, left="")

    def report(what: str, share: float, left_s: float) -> None:
        left = f"{left_s:.0f} s left" if left_s == left_s else ""
        bar.update(task, description=f"{order.network}: {what}", completed=share, left=left)

    return [(order, train_one(order, report))]


def _many(
    wanted: list[Any], bar: Progress, jobs: int | None, engine: Engine, address: str | None
) -> list[tuple[Any, dict[str, Any]]]:
    from acqd.models.protocol import run_order
    from acqd.workers import run_here, run_on_ray

    task = bar.add_task("training", total=len(wanted), left=f"0 of {len(wanted)}")
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # of workers: one thread each, networks are small
    tick = bar.refresh
    if engine is Engine.RAY:
        done = run_on_ray(run_order, wanted, address, tick)
    else:
        done = run_here(run_order, wanted, jobs or os.cpu_count() or 1, tick)
    made: dict[str, dict[str, Any]] = {}
    for number, (path, about) in enumerate(done, start=1):
        made[path] = about
        bar.update(task, completed=number, left=f"{number} of {len(wanted)}")
    return [(order, made[str(order.out)]) for order in wanted]
