"""`acqd energy` and its subcommands."""

from __future__ import annotations

import typer

from acqd.cli.energy.causes import causes
from acqd.cli.energy.period import energy
from acqd.cli.energy.work import work

app = typer.Typer(invoke_without_command=True)
app.callback()(energy)
app.command()(causes)
app.command()(work)
