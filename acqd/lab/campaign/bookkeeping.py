"""What a campaign writes down besides its recordings: which sessions are finished, the manifest and the truth."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import orjson
import sqlalchemy as sa

from acqd import __version__
from acqd.errors import InputError, OperationError, UserError
from acqd.lab.campaign.folders import Folders, write_json
from acqd.lab.cell import build_cell, device_name
from acqd.lab.effects import EffectSpec, known_effects
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


def _lock_file(folders: Folders, settings: CampaignSettings) -> TextIO:
    """Create the folders, or check that they hold a campaign with the same settings."""
    requested = settings.model_dump(mode="json")
    path = folders.truth / "settings.json"
    try:
        stored = orjson.loads(path.read_bytes()) if path.exists() else None
        if stored is None and folders.out.exists() and (not folders.out.is_dir() or any(folders.out.iterdir())):
            raise UserError(f"{folders.out} is not empty, and {folders.truth} has no campaign; choose another --out")
        differing = sorted(key for key in requested if stored is not None and requested[key] != stored.get(key))
        if differing:
            raise UserError(
                f"{folders.out} holds a campaign with other settings ({', '.join(differing)}); "
                "choose another --out, or remove it and its truth folder"
            )
        folders.out.mkdir(parents=True, exist_ok=True)
        folders.truth.mkdir(parents=True, exist_ok=True)
        if stored is None:
            path.write_bytes(orjson.dumps(requested, option=orjson.OPT_INDENT_2))
        return (folders.truth / "lock").open("w")
    except (orjson.JSONDecodeError, AttributeError, TypeError):
        raise InputError(path, "is damaged; remove the campaign and its truth folder, and run it again") from None
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


def write_manifest(
    folders: Folders, settings: CampaignSettings, plans: list[SessionPlan], reports: list[SessionReport]
) -> None:
    """Write what an analyst may know: no undeclared effect, no clock, no true robot, and no seed to derive them."""
    by_session = {report["session"]: report for report in reports}
    manifest = {
        "acqd": __version__,
        "simulated": True,
        "profile": settings.profile,
        "robot": settings.robot,
        "window_s": settings.window_s,
        "log_period_s": settings.recorder.period_s,
        "effects": [_described(effect) for effect in settings.effects if effect.declared],
        "recordings": [entry for plan in plans for entry in _manifest_entries(plan, by_session[plan.name])],
    }
    write_json(folders.out / "campaign.json", manifest)


def _manifest_entries(plan: SessionPlan, report: SessionReport) -> list[dict[str, Any]]:
    return [
        {
            "name": planned.name,
            "space": planned.space,
            "source": planned.source_name,
            "device": report["device"],
            "session": plan.name,
            "boot": report["boot"],
            "log_rows": recording["rows"],
        }
        for planned, recording in zip(plan.recordings, report["recordings"], strict=True)
    ]


def write_truth(folders: Folders, settings: CampaignSettings, reports: list[SessionReport]) -> None:
    """Write everything that really happened: all effects, the plant, the true robots and the session reports."""
    cells = [build_cell(settings, number) for number in range(settings.cells)]
    truth = {
        "acqd": __version__,
        "simulated": True,
        "settings": settings.model_dump(mode="json"),
        "effects": [_described(effect) for effect in settings.effects],
        "plant": cells[0].parameters.model_dump(mode="json"),
        "true_robots": [
            [
                {"joint": joint.name, **joint.link.model_dump(), "rotor_inertia_kgm2": joint.drive.rotor_inertia_kgm2}
                for joint in cell.true_arm.description.joint
            ]
            for cell in cells
        ],
        "sessions": reports,
    }
    write_json(folders.truth / "truth.json", truth)


def _described(spec: EffectSpec) -> dict[str, Any]:
    effect = known_effects()[spec.id]
    return spec.model_dump() | {"about": effect.summary, "values": {**effect.defaults, **spec.values}}
