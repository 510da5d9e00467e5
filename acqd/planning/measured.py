"""Measured figures, each with the command that prints it: those of the package, and those of the user's computer."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

from acqd.errors import InputError


@dataclass(frozen=True, slots=True)
class Quantity:
    """A figure that a command has printed."""

    key: str
    value: float
    unit: str
    section: str
    """How the figure's section begins in the JSON of the command; empty: the command prints another form."""
    name: str
    """Name of the figure, as the command prints it."""
    command: str
    when: str
    """Day of the run, or of the file of figures."""
    machine: str
    """What it ran on, or the name of the file of figures."""


Measured = Mapping[str, Quantity]
"""Quantities by key."""


def shipped() -> dict[str, Quantity]:
    """The figures of `measured.toml`."""
    data = tomllib.loads(files("acqd.planning").joinpath("measured.toml").read_text(encoding="utf-8"))
    return {
        key: Quantity(
            key, figure["value"], figure["unit"], run.get("section", ""), figure["name"], run["command"],
            run["when"].isoformat(), run["machine"],
        )
        for run in data["run"]
        for key, figure in run["figures"].items()
    }  # fmt: skip


def replaced(measured: Measured, path: Path) -> dict[str, Quantity]:
    """`measured` with the figures of a file that `tools.bench --out` or `tools.studies.soak.fleet --json` has written.

    Shares of a core mean nothing without the rate at which they were measured, so a section counts as a whole. Raises
    InputError for another file, a section with a figure missing, and a value that is no positive number.
    """
    found = _figures(path)
    changed: dict[str, Quantity] = {}
    day = datetime.fromtimestamp(path.stat().st_mtime).date().isoformat()
    for section in dict.fromkeys(one.section for one in measured.values() if one.section):
        values = {name: value for begin, name, value in found if begin.startswith(section)}
        known = [one for one in measured.values() if one.section == section]
        if not any(one.name in values for one in known):
            continue
        for one in known:
            if one.name not in values:
                raise InputError(path, f"has no figure {one.name!r}; run {one.command} of this version again")
            value = values[one.name]
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < math.inf:
                raise InputError(path, f"{one.name!r} is {value!r}; expected a positive number")
            changed[one.key] = replace(one, value=float(value), when=day, machine=str(path))
    if not changed:
        commands = " or ".join(dict.fromkeys(one.command for one in measured.values() if one.section))
        raise InputError(path, f"holds no figure that a plan uses; expected the JSON of {commands}")
    return dict(measured) | changed


def _figures(path: Path) -> list[tuple[str, str, Any]]:
    """Section, name and value of all figures in a file."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None
    except ValueError:  # of the text or of its JSON
        raise InputError(path, "is no JSON; expected a list of figures with section, name, value, unit") from None
    try:
        return [(str(one["section"]), str(one["name"]), one["value"]) for one in content]
    except (TypeError, KeyError):
        raise InputError(path, "expected a list of figures with section, name, value, unit") from None


def by_section(quantities: Iterable[Quantity]) -> dict[tuple[str, str, str], list[Quantity]]:
    """Quantities by (command, day and machine, section), in their order."""
    groups: dict[tuple[str, str, str], list[Quantity]] = {}
    for one in quantities:
        groups.setdefault((one.command, f"{one.when}, {one.machine}", one.section), []).append(one)
    return groups
