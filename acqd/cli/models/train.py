"""`acqd train`: one model, or the 14 combinations of the thesis."""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer

from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.progress import Show, progress
from acqd.cli.terminal import terminal
from acqd.dataset.places import default_models
from acqd.errors import UserError
from acqd.extras import require
from acqd.report.digits import percent


class Engine(StrEnum):
    """What runs several trainings in parallel."""

    PROCESS = "process"
    RAY = "ray"


class Compute(StrEnum):
    """What computes the gradients of a network."""

    AUTO = "auto"
    FUSED = "fused"
    TORCH = "torch"


class Normal(StrEnum):
    """Normalisation of a network's inputs and target."""

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
    table_7_1: Annotated[
        bool,
        typer.Option("--table-7-1", help="Train the 14 combinations of network and data in Table 7.1 of the thesis."),
    ] = False,
    on: Annotated[list[str] | None, typer.Option(help="Kind of trajectories to train on (default all).")] = None,
    models: Annotated[Path | None, typer.Option(help="Folder for bundles (default DS.models).")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the bundle, in place of --models.")] = None,
    seed: Annotated[
        list[int] | None, typer.Option(min=0, help="Random seed; may be given several times (default 1).")
    ] = None,
    epochs: Annotated[int, typer.Option(min=1, help="Passes over all training recordings.")] = 2000,
    batch: Annotated[int, typer.Option(min=1, help="Sequences per optimiser step.")] = 11,
    rate: Annotated[
        float,
        typer.Option("--learning-rate", "--rate", min=1e-6, max=1, help="At the start; times 0.9 every 100 epochs."),
    ] = 0.02,
    patience: Annotated[
        int | None, typer.Option(min=1, help="Validations without improvement before training stops (default never).")
    ] = None,
    normalisation: Annotated[Normal, typer.Option(help="Fitted, or the thesis' constants.")] = Normal.FITTED,
    robot: Annotated[
        str | None, typer.Option(help="Robot description for grey-box and hybrid (default the dataset's).")
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            help="Term to withhold from a grey box: copper_loss, coulomb_friction, viscous_friction, mechanical_power."
        ),
    ] = None,
    prior: Annotated[
        Path | None,
        typer.Option(help="Prior of grey-box and hybrid: a fleet's file, or what acqd fleet wrote in priors/."),
    ] = None,
    compute: Annotated[Compute, typer.Option(help="Fused C (needs a compiler) or torch.")] = Compute.AUTO,
    device: Annotated[str, typer.Option("--processor", "--device", help="Of torch: cpu or cuda.")] = "cpu",
    jobs: Annotated[int | None, typer.Option(min=1, help="Trainings in parallel (default one per core).")] = None,
    engine: Annotated[Engine, typer.Option(help="Local processes, or a Ray cluster.")] = Engine.PROCESS,
    ray_address: Annotated[str | None, typer.Option(help="Address of the Ray cluster (default: start one).")] = None,
    json: Json = False,
) -> None:
    """Train models of power. An interrupted training of networks continues from its checkpoint.

    Examples: acqd train ds --network grey-box

    acqd train ds --network 21x1dim --seed 1 --seed 2

    acqd train ds --network grey-box --prior plant.toml

    acqd train ds --table-7-1
    """
    require("acqd train", ("safetensors", "scipy"), "data,predict")
    if (network is None) != table_7_1:
        raise UserError(
            "which model? --network grey-box learns from minutes of recordings; --table-7-1: all networks of the thesis"
        )
    if out is not None and (table_7_1 or len(seed or []) > 1):
        raise UserError("--out is the folder of one bundle; several models need --models")
    from acqd.models.config import GREY_BOX, HYBRID, TrainConfig
    from acqd.models.networks.settings import TrainingSettings
    from acqd.models.protocol import table_7_1_configs
    from acqd.models.training import bundle_name

    withheld = _withheld(network, without or [])
    if prior is not None and (withheld or network not in (GREY_BOX, HYBRID)):
        raise UserError("--prior is for --network grey-box and hybrid, without --without")
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
    configs: list[TrainConfig] = []
    for number in seed or [1]:
        kinds = tuple(on or ())
        path = out or folder / bundle_name(network or "", kinds, number)
        learned = None if prior is None else _learned(prior, dataset, path)
        config = TrainConfig(dataset, network or "", path, kinds, number, settings, robot, withheld, learned)
        configs += table_7_1_configs(config, folder) if table_7_1 else [config]
    console = terminal(stderr=True)
    with progress(console) as show_step:
        alone = len(configs) == 1 and engine is Engine.PROCESS
        results = _one(configs[0], show_step) if alone else _several(configs, show_step, jobs, engine, ray_address)
    if json:
        print(orjson.dumps([{"bundle": str(config.out)} | _short(metadata) for config, metadata in results]).decode())
        return
    _print_table(results)


def _withheld(network: str | None, terms: list[str]) -> tuple[str, ...]:
    """Parameter groups of the terms in --without. Raises UserError."""
    from acqd.models.effects import library

    groups = {effect.id: effect.restores for effect in library().values() if effect.restores}
    if terms and (network != "grey-box" or not set(terms) <= set(groups)):
        raise UserError(f"--without is for --network grey-box and takes {', '.join(groups)}")
    return tuple(group for term in terms for group in groups[term])


def _learned(prior: Path, dataset: Path, out: Path) -> Any:
    """A prior from its own file or from a fleet's, without the bundle that is to be written. Raises UserError."""
    from acqd.models.greybox.fleet_prior import FleetPrior

    if prior.suffix != ".toml":
        return FleetPrior.read(prior)
    from acqd.dataset.manifest import load_manifest
    from acqd.fleet.config import read_fleet
    from acqd.fleet.prior import prior_for

    return prior_for(read_fleet(prior), load_manifest(dataset)["robot"], out)


def _print_table(results: list[tuple[Any, dict[str, Any]]]) -> None:
    table = Table("bundle", "MAE train [W]", "validation", "test", "RMSE test", "energy p95 test", "seconds")
    for config, metadata in results:
        m = metadata["metrics"]
        cells = [f"{m[part]['mae']:.2f}" for part in ("train", "validation", "test")]
        table.add_row(
            str(config.out),
            *cells,
            f"{m['test']['rmse']:.2f}",
            percent(m["test"]["energy_p95"]),
            f"{metadata['training']['seconds']:.0f}",
        )
    wide = terminal()
    wide.width = max(wide.width, 120)
    wide.print(table)


def _short(metadata: dict[str, Any]) -> dict[str, Any]:
    return {key: metadata[key] for key in ("name", "metrics", "training")}


def _one(config: Any, show: Show) -> list[tuple[Any, dict[str, Any]]]:
    from acqd.models.training import train_one

    def report(activity: str, share: float, left_s: float) -> None:
        left = f", {left_s:.0f} s left" if left_s == left_s else ""
        show(f"{config.network}: {activity}{left}", share)

    return [(config, train_one(config, report))]


def _several(
    configs: list[Any], show: Show, jobs: int | None, engine: Engine, address: str | None
) -> list[tuple[Any, dict[str, Any]]]:
    from acqd.models.protocol import train_unless_done
    from acqd.workers import run_here, run_on_ray

    trained: dict[str, dict[str, Any]] = {}

    def tick() -> None:
        show(f"training: {len(trained)} of {len(configs)}", len(trained) / len(configs))

    os.environ.setdefault("OMP_NUM_THREADS", "1")  # networks are small: one thread per worker
    if engine is Engine.RAY:
        done = run_on_ray(train_unless_done, configs, address, tick)
    else:
        done = run_here(train_unless_done, configs, jobs or os.cpu_count() or 1, tick)
    for path, metadata in done:
        trained[path] = metadata
        tick()
    return [(config, trained[str(config.out)]) for config in configs]
