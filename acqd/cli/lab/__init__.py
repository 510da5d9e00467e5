"""`acqd lab`: the virtual laboratory. Only its commands need the `lab` extra."""

from __future__ import annotations

from importlib.util import find_spec

import typer

from acqd.cli.lab import campaign, effects, execute, trajectories
from acqd.errors import UserError

app = typer.Typer(no_args_is_help=True)


@app.callback()
def lab() -> None:
    """The virtual laboratory: excite a robot, measure it, know the truth. All data are simulated."""
    missing = [name for name in ("pinocchio", "scipy", "matplotlib") if find_spec(name) is None]
    if missing:
        raise UserError(f"acqd lab needs {' and '.join(missing)}: pip install 'acqd[lab]'")


app.command("trajectories")(trajectories.trajectories)
app.command("execute")(execute.execute)
app.command("campaign")(campaign.campaign)
app.command("effects")(effects.effects)
