"""`acqd lab effects`: the effects that can be switched on."""

from __future__ import annotations

import orjson

from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.terminal import terminal


def effects(json: Json = False) -> None:
    """List the effects of the virtual cell with their parameters.

    Example: acqd lab effects
    """
    from acqd.lab.effects import known_effects

    known = known_effects()
    if json:
        listed = [
            {"id": cls.id, "about": cls.summary, "strength": cls.strength[0], "unit": cls.strength[1]}
            | {"parameters": dict(cls.defaults)}
            for cls in known.values()
        ]
        print(orjson.dumps(listed).decode())
        return
    table = Table("effect", "what it does", "parameters (strength first)", "strength in")
    for cls in known.values():
        parameters = ",".join(f"{name}={value:g}" for name, value in cls.defaults.items())
        table.add_row(cls.id, cls.summary, parameters, cls.strength[1])
    console = terminal(soft_wrap=False)
    console.width = max(console.width, 170)  # parameter names must be readable to be used
    console.print(table)
