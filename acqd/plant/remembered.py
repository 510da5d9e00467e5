"""What daemons and sinks that are offline said of themselves: a broker keeps only that they are offline.

The last statuses are kept in a file of this user, one for each broker, whenever somebody asks that broker.
"""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import orjson

from acqd.atomic import write_complete
from acqd.errors import OperationError
from acqd.plant.heard import Heard, Status

_KEPT = ("name", "version", "started", "source", "boot", "host")
_TABLES = ("boxes", "meters")


def file_of(broker: str) -> Path:
    """In $STATE_DIRECTORY of a service, else $XDG_STATE_HOME/acqd, else ~/.local/state/acqd."""
    home = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "acqd"
    folder = Path(os.environ.get("STATE_DIRECTORY") or home)
    return folder / f"plant-{re.sub(r'[^A-Za-z0-9.-]+', '-', broker)}.json"


def remember(heard: Heard, file: Path) -> None:
    """Complete what was heard by earlier statuses, and keep those of now.

    A file that cannot be read or written is no error: the inventory lacks what it would have said.
    """
    earlier = _read(file)
    kinds: dict[str, dict[str, Status | None]] = {"daemons": heard.daemons, "sinks": heard.sinks}
    known = {kind: {**_table(earlier.get(kind)), **_now(statuses)} for kind, statuses in kinds.items()}
    for kind, statuses in kinds.items():
        for name in statuses:
            if statuses[name] is None and (last := _table(known[kind].get(name))):
                heard.remember(kind, name, last)
    if known != earlier:
        with suppress(OperationError):
            write_complete(file, orjson.dumps(known))


def _now(statuses: dict[str, Status | None]) -> dict[str, Status]:
    """Of those that are online, what tells host, version and devices."""
    return {name: _identity(status) for name, status in statuses.items() if status is not None}


def _identity(status: Status) -> Status:
    kept = {key: status[key] for key in _KEPT if key in status}
    return kept | {key: _names(status[key]) for key in _TABLES if isinstance(status.get(key), dict)}


def _names(table: Status) -> Status:
    """The names of boxes or meters, and of the meters of a box, without their values."""
    return {name: _identity(content) if isinstance(content, dict) else {} for name, content in table.items()}


def _read(file: Path) -> dict[str, Any]:
    try:
        return _table(orjson.loads(file.read_bytes()))
    except (OSError, orjson.JSONDecodeError):
        return {}


def _table(value: object) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}
