"""What a campaign writes down besides its recordings: which sessions are finished, the manifest and the truth."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import orjson
import sqlalchemy as sa

from acqd.atomic import replace_file, require_writable
from acqd.errors import InputError, OperationError, UserError, no_folder
from acqd.lab.campaign.folders import Folders
from acqd.lab.cell import device_name
from acqd.lab.instruments.row_file import rows_stored, store_rows
from acqd.lab.schedule import SessionPlan
from acqd.lab.settings import CampaignSettings

SessionReport = dict[str, Any]
"""What `run_session` returns."""
_REPORT_KEYS = {"session", "device", "boot", "windows", "recordings", "steady", "energy"}


@contextmanager
def claimed(folders: Folders, settings: CampaignSettings) -> Iterator[None]:
    """Lock the campaign's folders for this process; a campaign continues only with unchanged settings.

    Raises UserError when another process, other settings or other files occupy them.
    """
    with _lock_file(folders, settings) as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise UserError(f"{folders.out}: another process is running this campaign; wait for it") from None
        yield


def require_usable(folders: Folders, settings: CampaignSettings) -> bool:
    """Whether the folders hold a campaign with these settings already. Raises UserError where they hold others."""
    requested = settings.model_dump(mode="json")
    require_writable(folders.out)
    path = folders.truth / "settings.json"
    try:
        stored = orjson.loads(path.read_bytes()) if path.exists() else None
        if folders.out.exists() and not folders.out.is_dir():
            raise UserError(f"{folders.out}: {no_folder(folders.out)}; choose another --out")
        if stored is None and folders.out.exists() and any(folders.out.iterdir()):
            raise UserError(f"{folders.out} is not empty, and {folders.truth} has no campaign; choose another --out")
        differing = sorted(key for key in requested if stored is not None and requested[key] != stored.get(key))
        if differing:
            raise UserError(
                f"{folders.out} holds a campaign with other settings ({', '.join(differing)}); "
                "choose another --out, or remove it and its truth folder"
            )
        return stored is not None
    except (orjson.JSONDecodeError, AttributeError, TypeError):
        raise InputError(path, "is damaged; remove the campaign and its truth folder, and run it again") from None
    except OSError as error:
        raise UserError(f"{error.filename}: {error.strerror}; choose another --out") from None


def _lock_file(folders: Folders, settings: CampaignSettings) -> TextIO:
    """Create the folders, or check that they hold a campaign with the same settings."""
    known = require_usable(folders, settings)
    path = folders.truth / "settings.json"
    try:
        folders.out.mkdir(parents=True, exist_ok=True)
        folders.truth.mkdir(parents=True, exist_ok=True)
        if not known:
            replace_file(path, orjson.dumps(settings.model_dump(mode="json"), option=orjson.OPT_INDENT_2))
        return (folders.truth / "lock").open("w")
    except OSError as error:
        raise UserError(f"{error.filename}: {error.strerror}; choose another --out") from None


def session_logs(folders: Folders, settings: CampaignSettings, plan: SessionPlan) -> list[Path]:
    """The robot logs of a session that exist."""
    folder = folders.logs(device_name(settings, plan.cell))
    return [path for recording in plan.recordings for path in folder.glob(f"{recording.name}.*")]


def finished_report(
    folders: Folders, settings: CampaignSettings, plan: SessionPlan, database: sa.Engine
) -> SessionReport | None:
    """The report of a session whose logs, truth and rows are complete, else None. Stores rows that are not yet in SQL.

    Raises OperationError when the database refuses rows.
    """
    try:
        report: SessionReport = orjson.loads((folders.work / f"{plan.name}.json").read_bytes())
        complete = report.keys() >= _REPORT_KEYS
    except (FileNotFoundError, orjson.JSONDecodeError, AttributeError):
        return None
    complete = complete and len(session_logs(folders, settings, plan)) >= len(plan.recordings)
    if not complete or not (folders.truth / f"{plan.name}.npz").exists():
        return None
    if rows_stored(database, report["device"], report["boot"]) < report["windows"]:
        if not (folders.work / f"{plan.name}.jsonl").exists():
            return None
        ingest(folders, report, database)
    return report


def ingest(folders: Folders, report: SessionReport, database: sa.Engine) -> int:
    """Write the rows of a session into SQL, then delete its row file. Returns their number. Raises OperationError."""
    path = folders.work / f"{report['session']}.jsonl"
    count = store_rows(path, database)
    stored = rows_stored(database, report["device"], report["boot"])
    if not count == stored == report["windows"]:
        raise OperationError(
            f"session {report['session']}: {report['windows']} windows, {count} rows in {path}, {stored} in the "
            "database; remove the file and run the same command again"
        )
    path.unlink()
    return count
