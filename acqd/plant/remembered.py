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


def file_of(broker: str) -> Path | None:
    """In $STATE_DIRECTORY of a service, else $XDG_STATE_HOME/acqd, else ~/.local/state/acqd; None: without a home."""
    folder = _folder()
    return folder and folder / f"plant-{re.sub(r'[^A-Za-z0-9.-]+', '-', broker)}.json"


def _folder() -> Path | None:
    if service := os.environ.get("STATE_DIRECTORY"):
        return Path(service)
    if state := os.environ.get("XDG_STATE_HOME"):
        return Path(state) / "acqd"
    try:
        return Path.home() / ".local" / "state" / "acqd"
    except RuntimeError:  # a user without a home, as in a container
        return None


def remember(heard: Heard, file: Path | None) -> None:
    """Complete what was heard by earlier statuses, and keep those of now.

    A file that cannot be read or written is no error: the inventory lacks what it would have said.
    """
    if file is None:
        return
    earlier = _read(file)
    kinds: dict[str, dict[str, Status | None]] = {"daemons": heard.daemons, "sinks": heard.sinks}
    known = {kind: _of(_table(earlier.get(kind))) | _of(statuses) for kind, statuses in kinds.items()}
    for kind, statuses in kinds.items():
        for name in statuses:
            if statuses[name] is None and (last := _table(known[kind].get(name))):
                heard.remember(kind, name, last)
    if known != earlier:
        with suppress(OperationError):
            write_complete(file, orjson.dumps(known))


def _of(statuses: dict[str, Any]) -> dict[str, Status]:
    """Of those that are online, what tells host, version and devices."""
    return {name: _identity(status, len(_TABLES)) for name, status in statuses.items() if isinstance(status, dict)}


def _identity(status: Status, levels: int) -> Status:
    """With the names of boxes or meters, and of the meters of a box, without their values."""
    kept = {key: _flat(status[key]) for key in _KEPT if key in status}
    tables = {key: status[key] for key in _TABLES if levels and isinstance(status.get(key), dict)}
    return kept | {
        key: {name: _identity(_table(content), levels - 1) for name, content in table.items()}
        for key, table in tables.items()
    }


def _flat(value: Any) -> Any:
    """A value, or a table of values, without what a message has nested in it."""
    if isinstance(value, dict):
        return {key: one for key, one in value.items() if not isinstance(one, dict | list)}
    return None if isinstance(value, list) else value


def _read(file: Path) -> dict[str, Any]:
    try:
        return _table(orjson.loads(file.read_bytes()))
    except (OSError, orjson.JSONDecodeError):
        return {}


def _table(value: object) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}
