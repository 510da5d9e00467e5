"""A whole measured campaign: source trajectories, sessions, database, manifest, truth and report."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal, TypeAlias

from acqd.errors import UserError
from acqd.lab.campaign.bookkeeping import SessionReport, claimed, finished_report, ingest, require_usable, session_logs
from acqd.lab.campaign.folders import Folders
from acqd.lab.campaign.manifest import write_manifest, write_truth
from acqd.lab.campaign.run_session import run_session
from acqd.lab.campaign.summary import CampaignReport, metered_powers, summarise
from acqd.lab.campaign.trajectory_set import MANIFEST, TrajectorySet, draw, write
from acqd.lab.campaign.use_case import Assembly
from acqd.lab.cell import build_cell
from acqd.lab.report.campaign import campaign_report
from acqd.lab.schedule import SessionPlan, plan_sessions
from acqd.lab.settings import CampaignSettings
from acqd.storage.database import open_database
from acqd.workers import run_here, run_in_turn, run_on_ray

Engine = Literal["process", "ray", "here"]
"""Processes of this computer, a Ray cluster, or this process, one session after the other."""
Progress: TypeAlias = Callable[[str, float], None]
"""Takes the current step and the share done, 0 to 1."""


@dataclass(frozen=True, slots=True)
class CampaignConfig:
    """What to run, where to write it, and which processes do the work."""

    settings: CampaignSettings
    out: Path
    truth: Path
    database: str
    """URL; a plain path is SQLite."""
    jobs: int = 2
    engine: Engine = "process"
    ray_address: str | None = None


def run_campaign(config: CampaignConfig, progress: Progress) -> CampaignReport:
    """Run the sessions that are not finished yet. Raises UserError."""
    settings = config.settings
    folders = Folders(config.out, config.truth)
    plans = plan_sessions(settings)
    _check(folders, settings, plans)
    require_usable(folders, settings)
    progress("preparing", 0.0)
    prepared = _prepare(settings, folders, progress)  # before anything is written, so that bad input leaves no files
    with claimed(folders, settings):
        return _run(config, folders, plans, prepared, progress)


def _check(folders: Folders, settings: CampaignSettings, plans: list[SessionPlan]) -> None:
    if folders.truth == folders.out or folders.out in folders.truth.parents:
        raise UserError(f"--truth {folders.truth} is inside --out, which an analyst may read; choose another folder")
    if not plans:
        raise UserError("the campaign has no recordings; raise --limited or --all")
    last = max(recording.number for plan in plans for recording in plan.recordings)
    late = [effect for effect in settings.effects if effect.recording > last]
    if late:
        raise UserError(
            f"effect {late[0].id} starts with recording {late[0].recording}, but the campaign ends with {last}"
        )


def _prepare(settings: CampaignSettings, folders: Folders, progress: Progress) -> TrajectorySet | None:
    """Draw source trajectories that do not exist yet; for assemblies, plan one to prove that the robot can do it."""
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
        progress=lambda share: progress("drawing trajectories", share),
    )


def _run(
    config: CampaignConfig,
    folders: Folders,
    plans: list[SessionPlan],
    prepared: TrajectorySet | None,
    progress: Progress,
) -> CampaignReport:
    settings = config.settings
    database = open_database(config.database)
    if prepared is not None:
        write(prepared, build_cell(settings), folders.trajectories)
    reports = {plan.name: finished_report(folders, settings, plan, database) for plan in plans}
    unfinished = [plan for plan in plans if reports[plan.name] is None]
    rows = 0
    for new_report in _execute(config, folders, plans, unfinished, progress):
        reports[new_report["session"]] = new_report
        rows += ingest(folders, new_report, database)
    progress("writing", 1.0)
    finished = [report for plan in plans if (report := reports[plan.name]) is not None]
    write_manifest(folders, settings, plans, finished)
    write_truth(folders, settings, finished)
    powers = metered_powers(folders, finished)
    summary = summarise(folders, config.database, finished, powers)
    title = f"{settings.robot}, {len(powers)} recordings"
    campaign_report(title, powers, summary.spaces, settings.window_s, folders.out)
    summary.rows, summary.sessions_done_before = rows, len(plans) - len(unfinished)
    return summary


def _execute(
    config: CampaignConfig,
    folders: Folders,
    plans: list[SessionPlan],
    unfinished: list[SessionPlan],
    progress: Progress,
) -> Iterator[SessionReport]:
    """Reports of the `unfinished` sessions, in the order of completion. Progress is the share of logs that exist."""
    if not unfinished:
        return
    total = sum(len(plan.recordings) for plan in plans)
    for plan in unfinished:  # an interrupted session is repeated from its start
        for log in session_logs(folders, config.settings, plan):
            log.unlink(missing_ok=True)

    def tick() -> None:
        progress("executing", min(1.0, len(list(folders.out.glob("logs/*/*"))) / total))

    work = partial(_work, config.settings, folders)
    if config.engine == "ray":
        yield from run_on_ray(work, unfinished, config.ray_address, tick)
    elif config.engine == "here":
        yield from run_in_turn(work, unfinished, tick)
    else:
        yield from run_here(work, unfinished, config.jobs, tick)


def _work(settings: CampaignSettings, folders: Folders, plan: SessionPlan) -> SessionReport:
    """`run_session` with the plan as the last argument, for `partial`."""
    return run_session(settings, plan, folders)
