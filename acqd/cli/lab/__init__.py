"""`acqd lab`: the virtual laboratory. Only its commands need the `lab` extra."""

from __future__ import annotations

import typer

from acqd.cli.lab import campaign, effects, execute, investigate, trajectories
from acqd.extras import MOTION, require

app = typer.Typer(no_args_is_help=True)


@app.callback()
def lab() -> None:
    """The virtual laboratory: excite a robot, measure it, know the truth. All data are simulated."""
    require("acqd lab", ("jinja2", "matplotlib", *MOTION, "scipy"), "lab")


app.command("trajectories")(trajectories.trajectories)
app.command("execute")(execute.execute)
app.command("campaign")(campaign.campaign)
app.command("investigate")(investigate.investigate)
app.command("effects")(effects.effects)
