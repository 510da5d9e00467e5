"""What became of alarms: raised, acknowledged and resolved, in a file beside the state, of a bounded length."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import Any, BinaryIO

import orjson

from acqd.atomic import write_complete
from acqd.errors import InputError, OperationError
from acqd.integrations.alarms.book import Notification
from acqd.timestamps import rfc3339

_log = logging.getLogger(__name__)
_MOST = 5_000
"""Lines that stay when the file has grown to twice as many."""


def history_file(state: Path) -> Path:
    """The file beside the state file of `acqd alarms`."""
    return state.with_name(f"{state.stem}.history.jsonl")


class History:
    """Appends a line for each event but reminders. A disk that is full costs the line, never the alarm."""

    def __init__(self, path: Path, most: int = _MOST) -> None:
        self._path, self._most = path, most
        self._lines: int | None = None

    def add(self, told: Notification, now_ns: int) -> None:
        """Write down an event."""
        if told.event == "reminder":
            return
        alarm = told.alarm
        line = {"time": rfc3339(now_ns, 3), "event": told.event, "key": alarm.key, "since": alarm.since,
                "text": alarm.text, "by": alarm.acknowledged_by}  # fmt: skip
        try:
            with self._path.open("ab+") as file:
                file.write(_line_end(file) + orjson.dumps(line) + b"\n")
            self._shorten()
        except (OSError, OperationError) as error:
            _log.error("%s: the history of alarms cannot be written (%s)", self._path, error)

    def _shorten(self) -> None:
        if self._lines is None:
            self._lines = self._path.read_bytes().count(b"\n") - 1
        self._lines += 1
        if self._lines >= 2 * self._most:
            kept = self._path.read_bytes().splitlines(keepends=True)[-self._most :]
            write_complete(self._path, b"".join(kept))
            self._lines = len(kept)


def _line_end(file: BinaryIO) -> bytes:
    """What ends the last line of the file, which a power cut may have torn."""
    if not file.seek(0, os.SEEK_END):
        return b""
    file.seek(-1, os.SEEK_END)
    return b"" if file.read(1) == b"\n" else b"\n"


def read_history(path: Path) -> list[dict[str, Any]]:
    """Alarms, the newest first: key, text, since, acknowledged, acknowledged_by, resolved; damaged lines are left out.

    Raises InputError for a file that is not there or cannot be read.
    """
    try:
        lines = path.read_bytes().splitlines()
    except FileNotFoundError:
        raise InputError(path, "no such file: acqd alarms writes it with the first alarm; see [alarms] state") from None
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror}); may this user read it (sudo)?") from None
    found: dict[tuple[str, str], dict[str, Any]] = {}
    damaged = 0
    for line in lines:
        try:
            event = orjson.loads(line)
            place = str(event["key"]), str(event["since"])
            alarm = found.setdefault(
                place,
                {"key": place[0], "text": str(event["text"]), "since": place[1], "acknowledged": "",
                 "acknowledged_by": "", "resolved": ""},
            )  # fmt: skip
            if event["event"] == "acknowledged":
                alarm |= {"acknowledged": str(event["time"]), "acknowledged_by": str(event["by"])}
            elif event["event"] == "resolved":
                alarm["resolved"] = str(event["time"])
        except (orjson.JSONDecodeError, KeyError, TypeError):
            damaged += 1
    if damaged:
        _log.warning("%s: %d of %d lines are damaged and left out", path, damaged, len(lines))
    newest = sorted(found.values(), key=lambda alarm: str(alarm["since"]), reverse=True)
    later: dict[str, str] = {}
    for alarm in newest:  # an alarm of the same key and another cause took the place of this one
        alarm["resolved"] = alarm["resolved"] or later.get(alarm["key"], "")
        later[alarm["key"]] = alarm["since"]
    return newest
