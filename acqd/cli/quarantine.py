"""`acqd sink quarantine`: messages that the sink has not stored as rows, and what a person decides about them."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import orjson
import typer

from acqd.cli.folded_table import Table
from acqd.cli.options import ConfigFile, Json, configured
from acqd.cli.terminal import terminal
from acqd.errors import UserError

if TYPE_CHECKING:
    import sqlalchemy as sa

    from acqd.storage.quarantined import Which

app = typer.Typer(no_args_is_help=True)
Database = Annotated[str | None, typer.Option(help="SQLite file or URL (default acqd.sqlite, or the config's).")]
Device = Annotated[str | None, typer.Option(help="Entries of this device only.")]
Reason = Annotated[str | None, typer.Option(help="Entries whose reason holds this text only.")]
Numbers = Annotated[list[int] | None, typer.Argument(help="Numbers of entries, as `list` shows them.")]
All = Annotated[bool, typer.Option("--all", help="All entries that the other options leave.")]


@app.command("list")
def list_command(
    device: Device = None,
    reason: Reason = None,
    limit: Annotated[int, typer.Option(min=1, help="Show so many at most.")] = 50,
    config: ConfigFile = None,
    database: Database = None,
    json: Json = False,
) -> None:
    """List what is in quarantine, oldest first.

    Example: acqd sink quarantine list --device cell1
    """
    from acqd.storage.quarantined import Which, count, entries

    engine, which = _engine(config, database), Which((), device, reason)
    some, total = entries(engine, which, limit), count(engine, which)
    if json:
        told = [
            {"id": one.id, "received": one.received, "device": one.device, "topic": one.topic, "reason": one.reason}
            for one in some
        ]
        print(orjson.dumps({"total": total, "entries": told}).decode())
        return
    table = Table(title=f"{total} in quarantine", title_justify="left", box=None, pad_edge=False)
    for name in ("id", "received", "topic", "reason"):
        table.add_column(name)
    for one in some:
        table.add_row(str(one.id), one.received, one.topic, one.reason)
    terminal().print(table)


@app.command("show")
def show_command(
    number: Annotated[int, typer.Argument(help="Number of an entry.")],
    config: ConfigFile = None,
    database: Database = None,
    json: Json = False,
) -> None:
    """Show one entry whole.

    Example: acqd sink quarantine show 17
    """
    from acqd.storage.quarantined import Which, entries, require

    engine, which = _engine(config, database), Which([number])
    require(engine, which)
    (entry,) = entries(engine, which)
    told = {
        "id": entry.id,
        "received": entry.received,
        "topic": entry.topic,
        "reason": entry.reason,
        "message": entry.content,
    }
    print(orjson.dumps(told, option=0 if json else orjson.OPT_INDENT_2).decode())


@app.command("restore")
def restore_command(
    numbers: Numbers = None,
    device: Device = None,
    reason: Reason = None,
    everything: All = False,
    config: ConfigFile = None,
    database: Database = None,
    json: Json = False,
) -> None:
    """Store rows as they came, and take them out of quarantine; exit 1 when some have to stay.

    Example: acqd sink quarantine restore --device cell1 --reason "impossible time"
    """
    from acqd.storage.quarantined import require, restore

    engine, which = _engine(config, database), _chosen(numbers, device, reason, everything)
    require(engine, which)
    done = restore(engine, which)
    if json:
        print(orjson.dumps(asdict(done)).decode())
    else:
        print(
            f"{done.restored} rows restored; {done.conflicts} stay because another row with their key is stored, "
            f"{done.unusable} because they are no rows"
            + (f", {done.refused} because the database refuses them: {done.why_refused}" if done.refused else "")
        )
    if done.conflicts or done.unusable or done.refused:
        raise typer.Exit(1)


@app.command("drop")
def drop_command(
    numbers: Numbers = None,
    device: Device = None,
    reason: Reason = None,
    everything: All = False,
    yes: Annotated[bool, typer.Option("--yes", help="Delete them; without it, only say how many.")] = False,
    config: ConfigFile = None,
    database: Database = None,
    json: Json = False,
) -> None:
    """Delete entries for good.

    Example: acqd sink quarantine drop 17 18 --yes
    """
    from acqd.storage.quarantined import count, drop, require

    engine, which = _engine(config, database), _chosen(numbers, device, reason, everything)
    require(engine, which)
    if not yes:
        raise UserError(f"{count(engine, which)} entries would be deleted for good; add --yes to do that")
    dropped = drop(engine, which)
    print(orjson.dumps({"dropped": dropped}).decode() if json else f"{dropped} entries deleted")


def _engine(config: ConfigFile, database: str | None) -> sa.Engine:
    from acqd.storage.database import open_database

    return open_database(database or configured(config).sink.database, create=False)


def _chosen(numbers: list[int] | None, device: str | None, reason: str | None, everything: bool) -> Which:
    from acqd.storage.quarantined import Which

    if not (numbers or device or reason or everything):
        raise UserError("say which entries: their numbers, --device, --reason or --all")
    return Which(numbers or (), device, reason)
