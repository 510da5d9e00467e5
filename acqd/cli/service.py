"""`acqd service`: services of systemd, installed and removed."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Annotated

import orjson
import typer

from acqd.cli.options import Json
from acqd.errors import UserError
from acqd.installation.install import Root
from acqd.installation.install import install as carry_out
from acqd.installation.install import remove as undo
from acqd.installation.plan import SERVICES, Wanted, default_program
from acqd.telemetry.topics import valid_device

app = typer.Typer(help="The services of systemd.", no_args_is_help=True)
_RootOption = Annotated[Path, typer.Option("--root", help="Folder with the files of another system.")]


@app.callback()
def _service() -> None:
    """The services of systemd."""


@app.command()
def install(
    services: Annotated[
        list[str] | None, typer.Option("--with", help=f"{', '.join(SERVICES)}, or all; may be repeated.")
    ] = None,
    device: Annotated[
        str | None,
        typer.Option(help="Name of the device, and of its user at the broker (default: the installed, or box)."),
    ] = None,
    rights: Annotated[
        list[str] | None, typer.Option("--rights", help="raw-network or serial, as the source needs them.")
    ] = None,
    archive: Annotated[
        str | None, typer.Option(help="Keep all samples in this folder, on another disk for instance.")
    ] = None,
    broker: Annotated[
        bool | None,
        typer.Option("--broker/--no-broker", help="Passwords and access rules for mosquitto on this computer."),
    ] = None,
    program: Annotated[str | None, typer.Option(help="Path of the command acqd (default: this one).")] = None,
    start: Annotated[bool, typer.Option(help="Enable and start the services.")] = True,
    root: _RootOption = Path("/"),
    json: Json = False,
) -> None:
    """Create user, folders, units, capabilities, the broker's password and access rules. May be repeated.

    What is installed stays: configuration, device, services, rights. At first: daemon, sink and maintain.

    Example: sudo acqd service install --device hall-3 --rights raw-network --archive /srv/waveforms
    """
    chosen = tuple(services or ())
    if "all" in chosen:
        chosen = tuple(SERVICES)
    if device is not None and not valid_device(device):
        raise UserError(f"--device {device!r}: expected letters, digits, . _ -")
    path = program or default_program(shutil.which(sys.argv[0]) or sys.argv[0])
    system = Root(root)
    wanted = Wanted(path, chosen, device, tuple(rights or ()), archive, broker)
    carry_out(wanted, system, start=start)
    _report(system, json)


@app.command()
def remove(
    purge: Annotated[bool, typer.Option("--purge", help="Configuration, rows and the user as well.")] = False,
    root: _RootOption = Path("/"),
    json: Json = False,
) -> None:
    """Stop and remove the services and the broker's access rules. Configuration and rows stay, unless --purge.

    Example: sudo acqd service remove
    """
    system = Root(root)
    undo(system, purge=purge)
    _report(system, json)


def _report(system: Root, json: bool) -> None:
    if json:
        print(orjson.dumps({"root": str(system.folder), "done": system.done}).decode())
        return
    print("\n".join(system.done) or "nothing to do")
