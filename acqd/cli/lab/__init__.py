"""`acqd lab`: the virtual laboratory. Its commands need the `lab` extra; the rest of acqd does not."""

from __future__ import annotations

import typer

from acqd.cli.lab import campaign, effects, execute, trajectories

app = typer.Typer(help="The virtual laboratory: excite a robot, measure it, know the truth. Simulated throughout.")
app.command("trajectories")(trajectories.trajectories)
app.command("execute")(execute.execute)
app.command("campaign")(campaign.campaign)
app.command("effects")(effects.effects)
