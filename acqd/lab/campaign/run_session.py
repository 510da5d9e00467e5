"""One session of a campaign: a unit of work for any process, on this computer or in a cluster."""

from __future__ import annotations

import os
from dataclasses import asdict
from typing import Any

import numpy as np
import orjson

from acqd.arrays import Floats
from acqd.atomic import naming
from acqd.errors import OperationError
from acqd.lab.campaign.folders import Folders
from acqd.lab.campaign.programs import Programs
from acqd.lab.cell import Cell, build_cell
from acqd.lab.instruments.data_recorder import log_suffix
from acqd.lab.instruments.row_file import RowFile
from acqd.lab.schedule import SessionPlan, reserved_s
from acqd.lab.session import RecordingTruth, Session, SessionTruth, windows_within
from acqd.lab.settings import CampaignSettings
from acqd.motion.controller import Phase, Wait

_FIRST_PAUSE_S = 3.0  # standby at the start of a session, for `standby_W`


def run_session(settings: CampaignSettings, plan: SessionPlan, folders: Folders) -> dict[str, Any]:
    """Run one session and write its logs, row file and truth. Returns its report.

    The report is also written to `folders.work`, as the last file: a session without one is incomplete.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    cell = build_cell(settings, plan.cell)
    for folder in (folders.logs(cell.device), folders.work):
        folder.mkdir(parents=True, exist_ok=True)
    rows = RowFile(folders.work / f"{plan.name}.jsonl", cell.device, plan.boot(settings))
    complete = False
    try:
        truth = _play(cell, plan, folders, settings, rows)
        complete = True
    finally:
        rows.close(complete=complete)
    with naming(known := folders.truth / f"{plan.name}.npz"):
        np.savez_compressed(
            known,
            start_utc_ns=np.int64(truth.start_utc_ns),
            window_s=np.float64(truth.window_s),
            P_W=truth.power,
            P_without_effects_W=truth.clean_power,
            P_metered_W=truth.metered,
        )
    report = _report(cell, plan, truth) | {"boot": plan.boot(settings)}
    path = folders.work / f"{plan.name}.json"
    temporary = path.with_suffix(f".{os.getpid()}")
    with naming(path):
        temporary.write_bytes(orjson.dumps(report, option=orjson.OPT_SERIALIZE_NUMPY))
        temporary.replace(path)
    return report


def _play(cell: Cell, plan: SessionPlan, folders: Folders, settings: CampaignSettings, rows: RowFile) -> SessionTruth:
    programs = Programs(cell, folders)
    start_utc_ns = settings.start_utc_ns + round(plan.start_s * 1e9)
    session = Session(cell, plan.number, start_utc_ns, programs.start(plan.recordings[0]), rows.write)
    for index, recording in enumerate(plan.recordings):
        transfer = cell.planner.connect(session.controller.position, programs.start(recording))
        pause_s = settings.pause_s if index else _FIRST_PAUSE_S
        session.pause([Phase("transfer"), *transfer, Wait(pause_s)], recording.number)
        log = folders.logs(cell.device) / (recording.name + log_suffix(cell.robot))
        session.record(programs.program(recording), recording.number, recording.name, log)
        programs.imitate(recording)
    truth = session.finish()
    if session.elapsed_s > reserved_s(settings, len(plan.recordings)):
        raise OperationError(
            f"session {plan.name} took {session.elapsed_s:.0f} s of simulated time; slow motions need fewer waypoints"
        )
    return truth


def _report(cell: Cell, plan: SessionPlan, truth: SessionTruth) -> dict[str, Any]:
    windows = min(len(truth.power), len(truth.metered))
    power, metered = truth.power[:windows], truth.metered[:windows]
    return {
        "session": plan.name,
        "device": cell.device,
        "seconds": truth.energy["seconds"],
        "windows": windows,
        "energy": truth.energy,
        "steady": steady_error(power, metered, truth.window_s),
        "standby_W": float(np.median(metered[: round(1.5 / truth.window_s)])),
        "recordings": [asdict(recording) | _figures(truth, recording, plan) for recording in truth.recordings],
    }


def _figures(truth: SessionTruth, recording: RecordingTruth, plan: SessionPlan) -> dict[str, Any]:
    space = next(planned.space for planned in plan.recordings if planned.number == recording.number)
    part = windows_within(recording.start_s, recording.seconds, truth.window_s)
    hidden = truth.power[part] - truth.clean_power[part]
    return {
        "space": space,
        "hidden_W": {"mean": float(hidden.mean()), "rms": float(np.sqrt(np.mean(hidden**2)))},
    }


def steady_error(power: Floats, metered: Floats, window_s: float = 0.04, calm_W: float = 6.0) -> dict[str, float]:
    """Relative error of metered against true power [windows] while the arm stands still, per window and per second.

    A second is steady when the true mean power of its windows varies by less than `calm_W`. The fluctuation of the
    standby load stays below this limit; a moving arm exceeds it. A metered window ends up to one mains cycle before
    its nominal end. A change of power during that time shows in single windows and averages out over a second.
    """
    per_second = round(1 / window_s)
    seconds = len(power) // per_second
    true, read = (values[: seconds * per_second].reshape(seconds, per_second) for values in (power, metered))
    calm = (np.ptp(true, axis=1) < calm_W) & np.isfinite(read).all(axis=1)
    if not calm.any():
        return {"windows": 0, "window_rms": 0.0, "window_worst": 0.0, "second_worst": 0.0}
    window = read[calm] / true[calm] - 1.0
    second = read[calm].mean(axis=1) / true[calm].mean(axis=1) - 1.0
    return {
        "windows": int(calm.sum()) * per_second,
        "window_rms": float(np.sqrt(np.mean(window**2))),
        "window_worst": float(np.abs(window).max()),
        "second_worst": float(np.abs(second).max()),
    }
