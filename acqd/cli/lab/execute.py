"""`acqd lab execute`: one trajectory or one recorded motion on the virtual cell."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer

from acqd.cli.lab.options import Effects, LabFile, Robot, RobotSeed, Scene, Seed, settings_from
from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.errors import UserError

if TYPE_CHECKING:
    from acqd.lab.settings import LabSettings


def execute(
    file: Annotated[Path, typer.Argument(help="Trajectory (CSV in degrees), program (.toml), or a robot log.")],
    out: Annotated[Path | None, typer.Option(help="Folder for rows, log, truth and report.")] = None,
    live: Annotated[bool, typer.Option("--live", help="Run in real time through the daemon, over MQTT.")] = False,
    waveform: Annotated[bool, typer.Option("--waveform", help="Also write the 20 kHz samples (NPZ).")] = False,
    robot: Robot = None,
    scene: Scene = None,
    seed: Seed = None,
    robot_seed: RobotSeed = None,
    effect: Effects = None,
    worked: Annotated[
        float | None, typer.Option(min=0, metavar="MINUTES", help="That the robot has worked before: gears are warm.")
    ] = None,
    settings: LabFile = None,
    config: Annotated[
        Path | None, typer.Option("--config", "-c", help="acqd.toml for --live; must be named here.")
    ] = None,
    json: Json = False,
) -> None:
    """Execute a trajectory with random speed and blending, meter its power, and balance its energy.

    Examples: acqd lab execute trajectories/all_01.csv --out run1

    acqd lab execute trajectories/all_01.csv --live
    """
    from acqd.lab import single_run as lab
    from acqd.lab.effects import parse_effect
    from acqd.lab.settings import LabSettings

    if live and waveform:
        raise UserError("--live writes no files; use --waveform with --out")
    if live == (out is not None):
        raise UserError("give either --out FOLDER (full speed, to files) or --live (real time, over MQTT)")
    specs = [parse_effect(text) for text in effect or []]
    given = {"robot": robot, "scene": scene, "seed": seed, "robot_seed": robot_seed, "worked_min": worked}
    chosen = settings_from(LabSettings, settings, given, specs)
    if out is not None:
        report = lab.execute(chosen, file, out, waveform=waveform)
        if json:
            print(orjson.dumps(report).decode())
        else:
            _print(report)
        return
    _serve_live(chosen, file, config, json=json)


def _serve_live(chosen: LabSettings, file: Path, config: Path | None, *, json: bool) -> None:
    from acqd.cli.serve import announce, demonstration_port, serve
    from acqd.daemon.config import Config
    from acqd.daemon.config_file import load_config
    from acqd.daemon.source_sections import ReplaySection
    from acqd.lab.single_run import render

    with tempfile.TemporaryDirectory(prefix="acqd-live-") as folder:
        path = render(chosen, file, Path(folder))
        daemon = load_config(config) if config else Config.demonstration(demonstration_port())
        daemon.sources = []
        daemon.source = ReplaySection(kind="replay", file=path)
        daemon.metering.window = chosen.window_s
        if not config:
            daemon.device = f"{chosen.device}-01"
            announce(daemon, f"virtual {chosen.robot} executing {file.name}", json=json)
        serve(daemon, None, json=json, quiet=config is not None, title=f"acqd lab execute {file.name}")


def _print(report) -> None:  # type: ignore[no-untyped-def]
    console = terminal()
    console.print(
        f"{report.name} on the virtual {report.robot} (simulated): {report.seconds:.1f} s, {report.rows} windows\n"
        f"P mean {report.P_mean_W:.1f} W, p99 {report.P_p99_W:.1f} W, max {report.P_max_W:.1f} W; "
        f"effects add {report.hidden_rms_W:.2f} W RMS\n"
        f"energy balance error: {report.energy_unaccounted:.1e} of the supplied energy"
    )
    for path in report.files:
        console.print(f"  {path}")
