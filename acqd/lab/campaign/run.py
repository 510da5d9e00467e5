"""A whole measured campaign: trajectories, sessions, database, manifest, truth."""

from __future__ import annotations

import fcntl
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import orjson
import sqlalchemy as sa

from acqd import __version__
from acqd.arrays import Floats
from acqd.errors import InputError, OperationError, UserError
from acqd.lab.campaign.run_session import Folders, run_session
from acqd.lab.campaign.trajectory_set import MANIFEST, Generated, draw, write
from acqd.lab.cell import build_cell, device_name
from acqd.lab.effects import known_effects
from acqd.lab.instruments.row_file import rows_stored, store_rows
from acqd.lab.motion.use_case import Assembly
from acqd.lab.report.pages import campaign_report
from acqd.lab.schedule import SessionPlan, plan_sessions
from acqd.lab.session import windows_within
from acqd.lab.settings import CampaignSettings
from acqd.storage.database import open_database
from acqd.workers import run_here, run_on_ray

Engine = Literal["process", "ray"]


@dataclass(frozen=True, slots=True)
class CampaignConfig:
    """What to do, and how."""

    settings: CampaignSettings
    out: Path
    truth: Path
    database: str
    """URL; a plain path is SQLite."""
    jobs: int = 2
    engine: Engine = "process"
    ray_address: str | None = None


@dataclass(slots=True)
class CampaignReport:
    """What was done."""

    out: str
    truth: str
    database: str
    recordings: int = 0
    recorded_s: float = 0.0
    streamed_s: float = 0.0
    rows: int = 0
    sessions_done_before: int = 0
    sample_pairs: int = 0
    standby_W: float = 0.0
    spaces: dict[str, dict[str, float]] = field(default_factory=dict)
    """Per space: recordings, hours, mean, p99 and max of metered P [W]."""
    steady_error: dict[str, float] = field(default_factory=dict)
    """Metered against true power in steady state, relative: RMS per window, worst second."""
    energy_unaccounted: float = 0.0
    """Worst session, share of the supplied energy."""
    simulated: bool = True


def run_campaign(order: CampaignConfig, progress: Callable[[str, float], None]) -> CampaignReport:
    """Run what has not been run yet. `progress` gets a sentence and the share done. Raises UserError."""
    settings = order.settings
    folders = Folders(order.out, order.truth)
    plans = plan_sessions(settings)
    if folders.truth == folders.out or folders.out in folders.truth.parents:
        raise UserError(f"--truth {folders.truth} lies in what an analyst may read; choose a folder outside --out")
    if not plans:
        raise UserError("the campaign has no recordings; raise --limited or --all")
    last = max(recording.number for plan in plans for recording in plan.recordings)
    late = [effect for effect in settings.effects if effect.recording > last]
    if late:
        raise UserError(
            f"effect {late[0].id} begins with recording {late[0].recording}, but the campaign ends with {last}"
        )
    progress("preparing", 0.0)
    prepared = _prepare(settings, folders)  # what cannot be done is known before anything is written
    with _claimed(folders, settings):
        return _run(order, folders, plans, prepared, progress)


def _run(
    order: CampaignConfig,
    folders: Folders,
    plans: list[SessionPlan],
    prepared: Generated | None,
    progress: Callable[[str, float], None],
) -> CampaignReport:
    settings = order.settings
    database = open_database(order.database)
    if prepared is not None:
        write(prepared, build_cell(settings), folders.trajectories)
    reports = {plan.name: _finished(folders, settings, plan, database) for plan in plans}
    left = [plan for plan in plans if reports[plan.name] is None]
    rows = 0
    for done in _execute(order, folders, plans, left, progress):
        reports[done["session"]] = done
        rows += _ingest(folders, done, database)
    progress("writing", 1.0)
    finished = [report for plan in plans if (report := reports[plan.name]) is not None]
    _write_manifest(folders, settings, plans, finished)
    _write_truth(folders, settings, finished)
    powers = metered_powers(order.truth, finished)
    summary = _summarise(order, finished, powers)
    title = f"{settings.robot}, {len(powers)} recordings"
    campaign_report(title, powers, summary.spaces, settings.window_s, folders.out)
    summary.rows, summary.sessions_done_before = rows, len(plans) - len(left)
    return summary


def _prepare(settings: CampaignSettings, folders: Folders) -> Generated | None:
    """Source trajectories, unless they are there; for assemblies, the proof that the robot can do one."""
    cell = build_cell(settings)
    if settings.profile == "use-case":
        Assembly(cell.arm, cell.planner).program(cell.random(0))
        return None
    if (folders.trajectories / MANIFEST).exists():
        return None
    return draw(
        cell,
        limited=min(settings.limited, settings.limited_sources),
        all_space=min(settings.all_space, settings.all_space_sources),
    )


def _execute(
    order: CampaignConfig,
    folders: Folders,
    plans: list[SessionPlan],
    left: list[SessionPlan],
    progress: Callable[[str, float], None],
) -> Iterator[dict[str, Any]]:
    """Reports of the sessions in `left` as they come; the logs that exist say how far the others are."""
    if not left:
        return
    total = sum(len(plan.recordings) for plan in plans)
    for plan in left:  # half-done sessions begin again
        for log in _logs(folders, order.settings, plan):
            log.unlink(missing_ok=True)

    def tick() -> None:
        progress("executing", min(1.0, len(list(folders.out.glob("logs/*/*"))) / total))

    work = partial(_work, order.settings, folders)
    if order.engine == "ray":
        yield from run_on_ray(work, left, order.ray_address, tick)
    else:
        yield from run_here(work, left, order.jobs, tick)


def _logs(folders: Folders, settings: CampaignSettings, plan: SessionPlan) -> list[Path]:
    folder = folders.logs(device_name(settings, plan.cell))
    return [path for recording in plan.recordings for path in folder.glob(f"{recording.name}.*")]


def _work(settings: CampaignSettings, folders: Folders, plan: SessionPlan) -> dict[str, Any]:
    return run_session(settings, plan, folders)


@contextmanager
def _claimed(folders: Folders, settings: CampaignSettings) -> Iterator[None]:
    """Have the folders to ourselves; go on in them only with the same settings. Raises UserError."""
    mine = settings.model_dump(mode="json")
    seal = folders.truth / "settings.json"
    try:
        theirs = orjson.loads(seal.read_bytes()) if seal.exists() else None
        if theirs is None and folders.out.exists() and (not folders.out.is_dir() or any(folders.out.iterdir())):
            raise UserError(
                f"{folders.out} is not empty, and {folders.truth} says of no campaign in it; choose another --out"
            )
        differing = sorted(key for key in mine if theirs is not None and mine[key] != theirs.get(key))
        if differing:
            raise UserError(
                f"{folders.out} holds a campaign with other settings ({', '.join(differing)}); "
                "choose another --out, or remove it and its truth folder"
            )
        folders.out.mkdir(parents=True, exist_ok=True)
        folders.truth.mkdir(parents=True, exist_ok=True)
        if theirs is None:
            seal.write_bytes(orjson.dumps(mine, option=orjson.OPT_INDENT_2))
        lock = (folders.truth / "lock").open("w")
    except (orjson.JSONDecodeError, AttributeError, TypeError):
        raise InputError(seal, "is damaged; remove the campaign and its truth folder, and run it again") from None
    except OSError as error:
        raise UserError(f"{error.filename}: {error.strerror}; choose another --out") from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise UserError(f"{folders.out}: another process is running this campaign; wait for it") from None
        yield


def _finished(
    folders: Folders, settings: CampaignSettings, plan: SessionPlan, database: sa.Engine
) -> dict[str, Any] | None:
    """The report of a session whose logs, truth and rows are all there; else None, and it is done again."""
    try:
        report: dict[str, Any] = orjson.loads((folders.work / f"{plan.name}.json").read_bytes())
        told = {"session", "device", "boot", "windows", "recordings", "steady", "energy"} <= report.keys()
    except (FileNotFoundError, orjson.JSONDecodeError, AttributeError):
        return None
    if (
        not told
        or len(_logs(folders, settings, plan)) < len(plan.recordings)
        or not (folders.truth / f"{plan.name}.npz").exists()
    ):
        return None
    if rows_stored(database, report["device"], report["boot"]) < report["windows"]:
        if not (folders.work / f"{plan.name}.jsonl").exists():
            return None
        _ingest(folders, report, database)
    return report


def _ingest(folders: Folders, report: dict[str, Any], database: sa.Engine) -> int:
    """Rows of a session into SQL; the row file goes when they are all there. Raises OperationError."""
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


def _write_manifest(
    folders: Folders, settings: CampaignSettings, plans: list[SessionPlan], reports: list[dict[str, Any]]
) -> None:
    """What an analyst may know: no undeclared effect, no clock, no true robot, and no seed to get them by."""
    by_session = {report["session"]: report for report in reports}
    recordings = []
    for plan in plans:
        report = by_session[plan.name]
        for planned, done in zip(plan.recordings, report["recordings"], strict=True):
            recordings.append(
                {
                    "name": planned.name,
                    "space": planned.space,
                    "source": planned.source_name,
                    "device": report["device"],
                    "session": plan.name,
                    "boot": report["boot"],
                    "log_rows": done["rows"],
                }
            )
    manifest = {
        "acqd": __version__,
        "simulated": True,
        "profile": settings.profile,
        "robot": settings.robot,
        "window_s": settings.window_s,
        "log_period_s": settings.recorder.period_s,
        "effects": [_described(effect.id, effect.model_dump()) for effect in settings.effects if effect.declared],
        "recordings": recordings,
    }
    _write_json(folders.out / "campaign.json", manifest)


def _write_truth(folders: Folders, settings: CampaignSettings, reports: list[dict[str, Any]]) -> None:
    cells = [build_cell(settings, number) for number in range(settings.cells)]
    truth = {
        "acqd": __version__,
        "simulated": True,
        "settings": settings.model_dump(mode="json"),
        "effects": [_described(effect.id, effect.model_dump()) for effect in settings.effects],
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
    _write_json(folders.truth / "truth.json", truth)


def _described(identity: str, order: dict[str, Any]) -> dict[str, Any]:
    effect = known_effects()[identity]
    return order | {"about": effect.summary, "values": {**effect.defaults, **order["values"]}}


def _write_json(path: Path, content: dict[str, Any]) -> None:
    temporary = path.with_suffix(".part")
    temporary.write_bytes(orjson.dumps(content, option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY))
    temporary.replace(path)


def metered_powers(truth: Path, reports: list[dict[str, Any]]) -> dict[str, Floats]:
    """Metered P [windows] (W) of every recording, by `device/name`."""
    powers = {}
    for report in reports:
        path = truth / f"{report['session']}.npz"
        try:
            with np.load(path) as arrays:
                metered, window_s = arrays["P_metered_W"], float(arrays["window_s"])
        except (OSError, ValueError, KeyError, zipfile.BadZipFile):
            raise InputError(path, "is damaged; remove it and run the same command again") from None
        for recording in report["recordings"]:
            within = windows_within(recording["start_s"], recording["seconds"], window_s)
            powers[f"{report['device']}/{recording['name']}"] = metered[within]
    return powers


def _summarise(order: CampaignConfig, reports: list[dict[str, Any]], powers: dict[str, Floats]) -> CampaignReport:
    summary = CampaignReport(str(order.out), str(order.truth), order.database)
    recordings = [
        recording | {"log": f"{report['device']}/{recording['name']}"}
        for report in reports
        for recording in report["recordings"]
    ]
    summary.recordings = len(recordings)
    summary.recorded_s = sum(recording["seconds"] for recording in recordings)
    summary.streamed_s = sum(report["seconds"] for report in reports)
    summary.sample_pairs = round(summary.streamed_s * 20_000)
    summary.standby_W = float(np.median([report["standby_W"] for report in reports]))
    for space in sorted({recording["space"] for recording in recordings}):
        chosen = [recording for recording in recordings if recording["space"] == space]
        seconds = [recording["seconds"] for recording in chosen]
        hidden = [recording["hidden_W"]["rms"] ** 2 for recording in chosen]
        metered = np.concatenate([powers[recording["log"]] for recording in chosen])
        summary.spaces[space] = {
            "recordings": len(chosen),
            "hours": sum(seconds) / 3600,
            "mean_W": float(np.nanmean(metered)),
            "p99_W": float(np.nanpercentile(metered, 99)),
            "max_W": float(np.nanmax(metered)),
            "hidden_rms_W": float(np.sqrt(np.average(hidden, weights=seconds))),
        }
    steady = [report["steady"] for report in reports if report["steady"]["windows"]]
    if steady:
        windows = [part["windows"] for part in steady]
        summary.steady_error = {
            "windows": sum(windows),
            "window_rms": float(np.sqrt(np.average([part["window_rms"] ** 2 for part in steady], weights=windows))),
            "window_worst": max(part["window_worst"] for part in steady),
            "second_worst": max(part["second_worst"] for part in steady),
        }
    summary.energy_unaccounted = max(report["energy"]["unaccounted_share"] for report in reports)
    return summary
