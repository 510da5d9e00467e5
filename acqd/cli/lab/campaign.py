"""`acqd lab campaign`: a whole measured campaign."""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import orjson
import typer

from acqd.cli.folded_table import Table
from acqd.cli.lab.options import Effects, LabFile, Robot, RobotSeed, Scene, Seed, Undeclared, settings_from
from acqd.cli.options import Json
from acqd.cli.progress import progress
from acqd.cli.terminal import terminal
from acqd.errors import UserError


class Profile(StrEnum):
    """The motions of a campaign."""

    THESIS = "thesis"
    USE_CASE = "use-case"


class Engine(StrEnum):
    """How sessions are distributed."""

    PROCESS = "process"
    RAY = "ray"


def campaign(
    out: Annotated[Path, typer.Option(help="Folder of the campaign; an unfinished one is continued.")],
    profile: Annotated[Profile | None, typer.Option(help="Random trajectories (default) or assemblies.")] = None,
    limited: Annotated[int | None, typer.Option(min=0, help="Recordings in limited space (default 202).")] = None,
    all_space: Annotated[
        int | None, typer.Option("--all", min=0, help="Recordings in all space (default 135).")
    ] = None,
    assemblies: Annotated[int | None, typer.Option(min=1, help="Recordings of the assembly (default 24).")] = None,
    session: Annotated[int | None, typer.Option(min=1, help="Recordings per power stream (default 24).")] = None,
    cells: Annotated[int | None, typer.Option(min=1, help="Virtual robots (default 1).")] = None,
    robot: Robot = None,
    scene: Scene = None,
    seed: Seed = None,
    robot_seed: RobotSeed = None,
    effect: Effects = None,
    undeclared: Undeclared = None,
    settings: LabFile = None,
    truth: Annotated[Path | None, typer.Option(help="Folder for the truth (default OUT.truth).")] = None,
    database: Annotated[str | None, typer.Option(help="SQL database of the rows (default OUT/power.sqlite).")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes (default: one per core).")] = None,
    engine: Annotated[Engine, typer.Option(help="Local processes, or a Ray cluster.")] = Engine.PROCESS,
    ray_address: Annotated[str | None, typer.Option(help="Address of a Ray cluster (default: start one here).")] = None,
    json: Json = False,
) -> None:
    """Measure many executions: power rows in SQL, robot logs with their own clock, the truth in a separate folder.

    Examples: acqd lab campaign --out campaign

    acqd lab campaign --out hidden --limited 20 --all 20 --undeclared payload:mass_kg=1.2,from=21
    """
    from acqd.lab.campaign.run import CampaignConfig, run_campaign
    from acqd.lab.effects import parse_effect
    from acqd.lab.settings import CampaignSettings

    if profile is Profile.USE_CASE and not (limited is None and all_space is None):
        raise UserError("--profile use-case repeats an assembly: use --assemblies instead of --limited and --all")
    specs = [parse_effect(text) for text in effect or []]
    specs += [parse_effect(text, declared=False) for text in undeclared or []]
    given = {
        "profile": profile and profile.value,
        "limited": limited,
        "all_space": all_space,
        "assemblies": assemblies,
        "session": session,
        "cells": cells,
        "robot": robot,
        "scene": scene,
        "seed": seed,
        "robot_seed": robot_seed,
    }
    config = CampaignConfig(
        settings_from(CampaignSettings, settings, given, specs),
        out.absolute(),
        (truth or out.with_name(out.name + ".truth")).absolute(),
        database or f"sqlite:///{out.absolute()}/power.sqlite",
        jobs or os.cpu_count() or 1,
        engine.value,
        ray_address,
    )
    console = terminal(stderr=True)
    with progress(console) as show_step:
        report = run_campaign(config, show_step)
    if json:
        print(orjson.dumps(report).decode())
    else:
        _print(report)


def _print(report) -> None:  # type: ignore[no-untyped-def]
    console = terminal()
    table = Table("space", "recordings", "hours", "mean P [W]", "p99 [W]", "max [W]", "effects [W RMS]")
    for name, figures in report.spaces.items():
        keys = ("hours", "mean_W", "p99_W", "max_W", "hidden_rms_W")
        table.add_row(name, str(figures["recordings"]), *(f"{figures[key]:.4g}" for key in keys))
    console.width = max(console.width, 100)  # long lines are better than truncated headers
    console.print(table)
    steady = report.steady_error
    accuracy = "no steady window"
    if steady:
        window, second = (100 * steady[name] for name in ("window_rms", "second_worst"))
        accuracy = f"error {window:.3f} % RMS per window, {second:.3f} % in the worst second"
    console.print(
        f"simulated: {report.recordings} recordings, {report.recorded_s / 3600:.2f} h recorded in "
        f"{report.streamed_s / 3600:.2f} h of power streams, {report.sample_pairs / 1e6:.0f} M sample pairs, "
        f"{report.rows} new rows\n"
        f"standby {report.standby_W:.1f} W; metered against true power in steady state: {accuracy}; "
        f"energy balance error: {report.energy_unaccounted:.1e}\n"
        f"campaign: {report.out}\nrows: {report.database}\ntruth (secret): {report.truth}"
    )
