"""The file of a fleet: one table per robot, a table of defaults, and what holds for all."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from acqd.errors import InputError
from acqd.fleet.robot import NAME, FleetRobot
from acqd.fleet.settings import Fleet, FleetSettings
from acqd.robot.section import Section, complaint, read_toml_table

_TABLES = ("fleet", "defaults", "robots")
_MOST_COMPLAINTS = 12
_Text = Annotated[str, Field(min_length=1)]


class Entry(Section):
    """Keys of a robot, and of the defaults. Paths are relative to the file; `{name}` stands for the robot's name."""

    model: _Text | None = None
    """Bundle of the robot."""
    power: _Text | None = None
    """SQL URL or file of power rows; "log": measured by the controller, in the logs."""
    logs: _Text | None = None
    """Folder of robot logs."""
    dataset: _Text | None = None
    """Dataset that is kept up to date elsewhere, in place of power and logs."""
    robot: _Text | None = None
    """Description; default: the bundle's."""
    device: _Text | None = None
    channel: _Text | None = None
    torque: Literal["measured", "model", "current"] | None = None
    search_s: Annotated[float, Field(ge=0.1)] | None = None
    lag_s: float | None = None
    cut: Literal["auto"] | Annotated[float, Field(ge=0)] | None = None


def read_fleet(path: Path) -> Fleet:
    """The fleet of a TOML file. Raises InputError that names every bad key by robot."""
    table = read_toml_table(path)
    faults = [
        f"{name}: there is no such table; the tables are {', '.join(_TABLES)}" for name in table.keys() - {*_TABLES}
    ]
    settings, complaints = _validated(FleetSettings, table.get("fleet", {}), "fleet")
    defaults, more = _validated(Entry, table.get("defaults", {}), "defaults")
    faults += complaints + more
    robots = table.get("robots", {})
    if not isinstance(robots, dict) or not robots:
        raise InputError(path, "names no robots; write a table [robots.NAME] for each")
    found: list[FleetRobot] = []
    for name, own in robots.items():
        if not NAME.fullmatch(name):
            faults.append(f"robots.{name}: expected a name of letters, digits and . _ -")
            continue
        entry, complaints = _validated(Entry, own, f"robots.{name}")
        faults += complaints
        if entry is None or defaults is None:
            continue
        merged = defaults.model_dump(exclude_none=True) | entry.model_dump(exclude_none=True)
        lacking = _lacking(merged, entry)
        faults += [f"robots.{name}.{key}" for key in lacking]
        if not lacking:
            found.append(_robot(path, name, merged))
    if faults or settings is None:
        rest = len(faults) - _MOST_COMPLAINTS
        more = [f"and {rest} more"] if rest > 0 else []
        raise InputError(path, "; ".join([*faults[:_MOST_COMPLAINTS], *more]))
    return Fleet(path, tuple(found), settings)


def _validated(model: Any, table: Any, where: str) -> tuple[Any, list[str]]:
    """The section, or None, and its complaints."""
    if not isinstance(table, dict):
        return None, [f"{where}: expected a table"]
    try:
        return model.model_validate(table), []
    except ValidationError as error:
        faults: dict[str, str] = {}
        for fault in error.errors():  # of a key that may have several types, the first complaint says it
            key = str(fault["loc"][0]) if fault["loc"] else where
            faults.setdefault(key, complaint({**fault, "loc": (where, key)}))
        return None, list(faults.values())


def _lacking(merged: dict[str, Any], own: Entry) -> list[str]:
    """Keys that are missing or exclude each other, with what is expected."""
    lacking = [] if "model" in merged else ["model is missing: the robot's bundle, from acqd train"]
    if own.dataset is not None and (own.power is not None or own.logs is not None):
        return [*lacking, "dataset: excludes power and logs; the dataset holds both"]
    if "dataset" in merged:
        return lacking
    texts = {"power": "SQL URL or file of power rows", "logs": "folder of robot logs"}
    return lacking + [f"{key} is missing: {text}, or a dataset" for key, text in texts.items() if key not in merged]


def _robot(path: Path, name: str, merged: dict[str, Any]) -> FleetRobot:
    """The robot with absolute paths."""
    folder = path.absolute().parent

    def place(key: str) -> Path | None:
        return folder / merged[key].replace("{name}", name) if key in merged else None

    model = place("model")
    assert model is not None
    own_logs = "dataset" not in merged
    return FleetRobot(
        name=name, model=model, dataset=place("dataset"), logs=place("logs") if own_logs else None,
        power=_power(folder, merged["power"].replace("{name}", name)) if own_logs else None,
        description=_description(folder, merged.get("robot")),
        **{key: merged[key] for key in ("device", "channel", "torque", "search_s", "lag_s") if key in merged},
        cut_s=merged.get("cut"),
    )  # fmt: skip


def _power(folder: Path, text: str) -> str:
    return text if text == "log" or "://" in text else str(folder / text)


def _description(folder: Path, text: str | None) -> str | None:
    """A shipped robot by name, or the path of a description."""
    return str(folder / text) if text is not None and (text.endswith(".toml") or "/" in text) else text
