"""`acqd config`: the commented configuration file; checked, compared, brought up to date."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from difflib import unified_diff
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import orjson
import typer
from rich.console import Console
from rich.markup import escape

from acqd.atomic import write_new
from acqd.cli.findings_table import findings_table
from acqd.cli.folded_table import Table
from acqd.cli.options import ConfigFile, Json, config_file
from acqd.errors import UserError

if TYPE_CHECKING:
    from acqd.daemon.config import Config
    from acqd.daemon.finding import Finding

app = typer.Typer(help="The configuration file.", no_args_is_help=True)


@app.callback()
def _config() -> None:
    """The configuration file."""


@app.command()
def init(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Where to write it; - is stdout.")] = Path("acqd.toml"),
    json: Json = False,
) -> None:
    """Write acqd.toml with every key, its default and its meaning. An existing file is left as it is.

    Example: acqd config init acqd.toml
    """
    text = files("acqd.daemon").joinpath("acqd.toml").read_text(encoding="utf-8")
    if str(path) == "-":
        print(text, end="")
        return
    try:
        write_new(path, text.encode())
    except FileExistsError:
        raise UserError(f"{path} exists: remove it, or name another file") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror})") from None
    print(orjson.dumps({"file": str(path)}).decode() if json else f"{path}: try it with acqd run --config {path}")


_File = Annotated[Path | None, typer.Argument(metavar="[FILE]", help="Default: ./acqd.toml, else /etc/acqd/acqd.toml.")]


@app.command()
def check(
    path: _File = None,
    config: ConfigFile = None,
    connect: Annotated[
        bool, typer.Option("--connect", help="Log in at the broker as every user, and open the database.")
    ] = False,
    json: Json = False,
) -> None:
    """Check a file: every key, and that passwords, certificates and folders are there; exit 1 where one is not.

    Example: sudo acqd config check /etc/acqd/acqd.toml --connect
    """
    from acqd.daemon.config_checks import config_checks
    from acqd.daemon.config_file import load_config

    file = _chosen(path, config)
    settings = load_config(file)
    findings = [*_keys(file), *_tariff(settings), *config_checks(settings, connect=connect)]
    if json:
        print(orjson.dumps([asdict(finding) for finding in findings]).decode())
    else:
        Console().print(findings_table(findings))
    if any(finding.state == "fail" for finding in findings):
        raise typer.Exit(1)


@app.command()
def diff(
    path: _File = None,
    config: ConfigFile = None,
    other: Annotated[
        Path | None, typer.Argument(metavar="[OTHER]", help="Another file (default: the defaults of this version).")
    ] = None,
    json: Json = False,
) -> None:
    """Show which keys of a file differ from the defaults, or from another file. Secrets are not shown.

    With --config FILE, the first file by its place is OTHER. Example: acqd config diff /etc/acqd/acqd.toml hall-4.toml
    """
    from acqd.daemon.config import Config
    from acqd.daemon.config_file import parsed_config, read_toml
    from acqd.daemon.config_values import differences, shown

    if config is not None and other is None:  # --config names the file, so the one by its place is the other
        path, other = None, path
    file = _chosen(path, config)
    two = [parsed_config(read_toml(one), one) if one else Config() for one in (file, other)]
    found = [(key, shown(key, here), shown(key, there)) for key, here, there in differences(two[0], two[1])]
    name = str(other) if other else "default"
    if json:
        print(orjson.dumps([{"key": key, "value": here, name: there} for key, here, there in found]).decode())
        return
    table = Table("key", str(file), name)
    for row in found:
        table.add_row(*(escape(text) for text in row))
    Console().print(table if found else f"{file}: nothing differs from {other or 'the defaults'}", soft_wrap=not found)


@app.command()
def upgrade(
    path: _File = None,
    config: ConfigFile = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show what would change, and change nothing.")] = False,
    json: Json = False,
) -> None:
    """Rewrite a file of an earlier version, with its comments; what was there stays as FILE.DATE.

    Keys without effect go. Next to the installed acqd.toml, sink.toml, sidecar.toml, web.toml and bridge.toml of
    earlier versions become part of it.

    Example: sudo acqd config upgrade /etc/acqd/acqd.toml --dry-run
    """
    from acqd.installation.config_upgrade import carry_out, planned

    plan = planned(_chosen(path, config))
    backups = [] if dry_run else carry_out(plan)
    lines = unified_diff(plan.before.splitlines(), plan.after.splitlines(), str(plan.path), "after", n=0, lineterm="")
    if json:
        report = {"file": str(plan.path), "changed": plan.needed and not dry_run, "notes": plan.notes}
        print(orjson.dumps(report | {"backups": [str(one) for one in backups], "diff": list(lines)}).decode())
        return
    told = [*plan.notes, *(lines if dry_run else ()), *(f"before: {backup}" for backup in backups)]
    if plan.merged:
        names = ", ".join(file.name for file in plan.merged)
        told.append(f"{names}: links to {plan.path.name} now; acqd service update makes units without them")
    print("\n".join(told) if plan.needed else f"{plan.path}: nothing to do")


def _chosen(path: Path | None, config: Path | None) -> Path:
    """The file of the command line, by its place or by --config, or where commands look. Raises UserError."""
    if path is not None and config is not None:
        raise UserError(f"{path} and --config {config}: expected one file; leave one of them out")
    file = config_file(path or config)
    if file is None:
        raise UserError("no acqd.toml here and in /etc/acqd: name a file, or acqd config init")
    return file


def _tariff(config: Config) -> Iterator[Finding]:
    """Of a zone that nobody knows, or a tariff that cannot be used."""
    from acqd.daemon.finding import Finding
    from acqd.energy.rules import rules_of

    try:
        rules_of(config.energy)
    except UserError as error:
        yield Finding("energy", "fail", str(error), "see [energy] in the configuration")


def _keys(file: Path) -> Iterator[Finding]:
    """What an upgrade would change, or how many keys are set."""
    from acqd.daemon.config import Config
    from acqd.daemon.config_file import parsed_config, read_toml
    from acqd.daemon.config_values import differences
    from acqd.daemon.finding import Finding
    from acqd.installation.config_upgrade import planned

    for note in (plan := planned(file)).notes:
        yield Finding("keys", "warn", note, "acqd config upgrade")
    if not plan.needed:
        changed = len(differences(parsed_config(read_toml(file), file), Config()))
        yield Finding("keys", "ok", f"every key is known; {changed} differ from the defaults (acqd config diff)")
