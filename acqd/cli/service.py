"""`acqd service`: services of systemd, installed, updated, backed up, restored and removed."""

from __future__ import annotations

import shutil
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer

from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.errors import UserError
from acqd.installation.install import install as carry_out
from acqd.installation.install import remove as undo
from acqd.installation.install import update as refresh
from acqd.installation.plan import LOGINS, SERVICES, Wanted, check_path, default_program
from acqd.installation.root import Root
from acqd.telemetry.topics import valid_device

if TYPE_CHECKING:
    from acqd.installation.state import State

app = typer.Typer(help="The services of systemd.", no_args_is_help=True)
_RootOption = Annotated[
    Path, typer.Option("--root", exists=True, file_okay=False, help="Folder with the files of another system.")
]
_ProgramOption = Annotated[str | None, typer.Option(help="Path of the command acqd (default: this one).")]
_BackupFile = Annotated[Path, typer.Argument(metavar="FILE", help="Written by acqd service backup.")]


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
    program: _ProgramOption = None,
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
    if device in LOGINS.values():
        raise UserError(f"--device {device}: a service of that name logs in at the broker; choose another one")
    path = _program(program)
    system = Root(root)
    wanted = Wanted(path, chosen, device, tuple(rights or ()), archive, broker)
    carry_out(wanted, system, start=start)
    _report(system, json)


@app.command()
def status(root: _RootOption = Path("/"), json: Json = False) -> None:
    """Show the installed services: do they run, since when, with which file and user; exit 1 when one does not.

    `acqd status` asks the services themselves how they are.

    Example: acqd service status
    """
    from acqd.installation.state import states

    found = states(Root(root))
    if json:
        print(orjson.dumps([asdict(one) | {"fine": one.fine} for one in found]).decode())
    elif not found:
        print(f"no service of acqd is installed below {root}")
    else:
        _print_states(found)
    if not found or not all(one.fine for one in found):
        raise typer.Exit(1)


@app.command()
def update(program: _ProgramOption = None, root: _RootOption = Path("/"), json: Json = False) -> None:
    """Bring units, rights and folders up to this version of acqd, and restart what runs.

    Device, configuration, passwords and access rules stay.

    Example: sudo acqd service update
    """
    system = Root(root)
    refresh(_program(program), system)
    _report(system, json)


@app.command()
def backup(
    out: Annotated[
        Path | None, typer.Option("--out", help="File to write (default: here, with computer and date).")
    ] = None,
    root: _RootOption = Path("/"),
    json: Json = False,
) -> None:
    """Write configuration, passwords, certificates, spool, registers and SQLite databases into one file.

    The services may run. The file holds passwords: only its owner may read it. Samples of the archive are not in it.

    Example: sudo acqd service backup --out /mnt/backup/hall-3.tar.gz
    """
    from acqd.installation.backup import back_up, default_name

    path = out or default_name()
    manifest = back_up(Root(root), path)
    size = path.stat().st_size
    if json:
        told = {"file": str(path), "bytes": size, "files": len(manifest.entries), "left_out": manifest.left_out}
        print(orjson.dumps(told | {"databases": manifest.databases}).decode())
        return
    from acqd.report.digits import quantity

    print(f"{path}: {len(manifest.entries)} files and folders, {quantity(size, 'B', 3)}")
    print(f"acqd service restore {path} --check reads it and compares")
    print("".join(f"not in it: {one}\n" for one in manifest.left_out), end="")


@app.command()
def restore(
    file: _BackupFile,
    check: Annotated[bool, typer.Option("--check", help="Read and verify everything, and restore nothing.")] = False,
    yes: Annotated[
        bool, typer.Option("--yes", help="Stop what runs, and move what is there aside (*.before-DATE).")
    ] = False,
    program: _ProgramOption = None,
    root: _RootOption = Path("/"),
    json: Json = False,
) -> None:
    """Put a backup in place: verified first, complete or not at all. Refuses to replace anything without --yes.

    Example: sudo acqd service restore /mnt/backup/hall-3.tar.gz --check
    """
    from acqd.installation.restore import restore as put_in_place
    from acqd.installation.restore import verify

    if check and yes:
        raise UserError("service restore: --check changes nothing, and --yes replaces what is there: give one")
    system = Root(root)
    verified = verify(system, file) if check else put_in_place(system, file, _program(program), overwrite=yes)
    manifest = verified.manifest
    if json:
        told: dict[str, object] = {"made": manifest.made, "computer": manifest.computer, "version": manifest.version}
        told |= {"files": len(manifest.entries), "rows": verified.rows, "left_out": manifest.left_out}
        print(orjson.dumps(told | {"done": system.done}).decode())
        return
    lines = [f"backup of {manifest.computer}, {manifest.made}: {len(manifest.entries)} files and folders"]
    lines += [f"{path}: {rows} rows" for path, rows in verified.rows.items()]
    lines += [f"not in it: {one}" for one in manifest.left_out]
    lines += ["everything is as it was stored; nothing was restored"] if check else system.done
    print("\n".join(lines))
    if not check and not any(line.startswith("started ") for line in system.done):
        chosen = "".join(f" --with {name}" for name in manifest.services if name.startswith("bridge-"))
        print(f"acqd service install{chosen} starts the services; acqd service status shows them")


@app.command()
def remove(
    purge: Annotated[bool, typer.Option("--purge", help="Configuration, rows and the user as well.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="With --purge: delete what is there.")] = False,
    root: _RootOption = Path("/"),
    json: Json = False,
) -> None:
    """Stop and remove the services and the broker's access rules. Configuration and rows stay, unless --purge.

    Example: sudo acqd service remove
    """
    system = Root(root)
    undo(system, purge=purge, sure=yes)
    _report(system, json)


def _print_states(found: list[State]) -> None:
    """A table that fits 80 columns; the files, which are long and mostly one, follow it."""
    table = Table("service", "unit", "starts", "state, since", "broker user")
    for one in found:
        since = " ".join(one.since.split()[1:3])  # systemd's day of the week and zone would break the line
        state = f"{one.state}, {since}" if since else one.state
        table.add_row(one.service, one.unit, "yes" if one.enabled else "no", state, one.user)
    console = terminal()
    console.print(table)
    for file in dict.fromkeys(one.configuration for one in found):
        of = [one.service for one in found if one.configuration == file]
        console.print(f"configuration{'' if len(of) == len(found) else ' of ' + ', '.join(of)}: {file}")
    for one in found:
        if one.last_line:
            console.print(f"{one.unit}: {one.last_line}")


def _program(given: str | None) -> str:
    """The command acqd, as units name it."""
    if given is not None:
        check_path("--program", given)
    return given or default_program(shutil.which(sys.argv[0]) or sys.argv[0])


def _report(system: Root, json: bool) -> None:
    if json:
        print(orjson.dumps({"root": str(system.folder), "done": system.done}).decode())
        return
    print("\n".join(system.done) or "nothing to do")
