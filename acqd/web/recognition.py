"""What a file is that a visitor has brought: a waveform, rows of power, or a log of the robot."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import orjson

from acqd.errors import InputError, UserError
from acqd.extras import require
from acqd.robot.bag import is_bag
from acqd.robot.description import RobotDescription
from acqd.robot.log_layout import layout_of
from acqd.robot.table import Table, text_of
from acqd.robot.table_text import joined, text_tables

_HEAD_BYTES = 1 << 16
_ROWS = {".jsonl", ".ndjson", ".sqlite", ".sqlite3", ".db"}
_TEXT = {".csv", ".log", ".txt"}
"""Of logs; with another suffix `acqd dataset build` passes a log over."""
_POWER_IN_LOGS = {"power", "actual_robot_voltage", "P"}
_COMPANIONS = {".cfg": ".dat"}
"""Files that belong to another of the same name."""


@dataclass(slots=True)
class Seen:
    """A file and what was seen in it."""

    name: str
    kind: Literal["", "waveform", "power", "log", "part", "unknown"] = ""
    says: str = ""


def readable_name(name: str) -> str:
    """A name by which a log is read."""
    path = Path(name)
    return name if path.suffix in (*_TEXT, ".parquet") or is_bag(path) else f"{name}.csv"


def _beginning(path: Path) -> Table:
    """The first rows of a table, of Parquet the names of the columns. Raises UserError, OSError, ValueError."""
    if path.suffix == ".parquet":
        require("Parquet", ("pyarrow",), "parquet")
        import pyarrow.parquet

        names = pyarrow.parquet.read_schema(path).names
        return Table(names, np.empty((0, len(names))), np.empty(0, np.int64))
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    whole = len(head) < _HEAD_BYTES
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        head = head.decode("utf-16", errors="ignore").encode()
    if b"\0" in head:
        raise InputError(path, "is no text")
    head = head if whole else head.rpartition(b"\n")[0]
    return joined(list(text_tables(path, text_of(path, io.BytesIO(head)))))


def kind_of(path: Path, robot: RobotDescription) -> Literal["power", "log", ""]:
    """A log by its columns, power by its ending or as another table with P and time; "" for another file."""
    if path.suffix in _ROWS:
        return "power"
    if is_bag(path):
        return "log"
    with contextlib.suppress(UserError, OSError, ValueError):
        table = _beginning(path)
        if layout_of(table, robot):
            return "log"
        names = set(table.header or ())
        return "power" if "P" in names and {"time", "filetime"} & names else ""
    return ""


def logs_have_power(logs: Path) -> bool:
    """Whether the logs have columns of power themselves."""
    with contextlib.suppress(UserError, OSError, ValueError):
        return all(not is_bag(path) and _POWER_IN_LOGS & set(_beginning(path).header or ()) for path in logs.iterdir())
    return False


def figures_of(rows: Path, found: dict[str, Any]) -> str:
    """Mean power and energy of metered rows: of the total, else of L1."""
    powers: dict[str, list[float]] = {"total": [], "L1": []}
    energies: dict[str, float] = {}
    with rows.open("rb") as lines:
        for line in lines:
            row = orjson.loads(line)
            if row["channel"] in powers and row["P"] is not None:
                powers[row["channel"]].append(row["P"])
                energies[row["channel"]] = row["W"] or 0.0
    seconds = found["samples"] / found["rate"] if found.get("rate") else 0.0
    channel = "total" if powers["total"] else "L1"
    chosen = powers[channel]
    if not chosen:
        return f"{seconds:.3g} s: no window of 40 ms is complete"
    return f"{seconds:.3g} s metered: mean power {np.mean(chosen):.5g} W, {1000 * energies[channel]:.4g} Wh"


def companions(names: Collection[str]) -> set[str]:
    """Names of files that belong to others of these names."""
    return {f"{Path(name).stem}{part}" for name in names for whole, part in _COMPANIONS.items() if name.endswith(whole)}
