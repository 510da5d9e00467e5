"""Tables of acqd.toml that belong to an integration: each stands beside the code that reads it.

The daemon knows none of them by name, because a new integration is to touch its own room only. A module below
`acqd.integrations` whose name ends in "section" has `TABLES`: name of the table -> its model.
"""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module

from acqd.section import Section

_ROOM = "acqd.integrations"


@cache
def integration_tables() -> dict[str, type[Section]]:
    """Model of every table, by its name."""
    found: dict[str, type[Section]] = {}
    for module in pkgutil.walk_packages(import_module(_ROOM).__path__, f"{_ROOM}."):
        if module.name.endswith("section"):
            found |= import_module(module.name).TABLES
    return dict(sorted(found.items()))
