"""A single execution on the virtual cell: a trajectory or a recorded motion, metered and logged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import orjson

from acqd.arrays import Floats
from acqd.atomic import naming
from acqd.errors import InputError, UserError
from acqd.lab.cell import MOTION, Cell, build_cell
from acqd.lab.instruments.data_recorder import log_suffix
from acqd.lab.instruments.mains import Mains
from acqd.lab.instruments.row_file import RowFile
from acqd.lab.report.execution import execution_report
from acqd.lab.session import Session, SessionTruth, windows_within
from acqd.lab.settings import LabSettings
from acqd.metering import WindowBatch
from acqd.metering.block import Codes
from acqd.motion.controller import Controller, Motion, Phase, Wait
from acqd.motion.program_file import read_program
from acqd.motion.replayed_log import motion_of
from acqd.motion.trajectory import read_trajectory
from acqd.robot.collision import require_free
from acqd.robot.last_line import LEFT_OUT
from acqd.robot.log_reader import read_log
from acqd.robot.table import read_table


@dataclass(slots=True)
class ExecutionReport:
    """Result of `execute`; `acqd lab execute --json` prints it."""

    name: str
    robot: str
    seconds: float
    rows: int
    P_mean_W: float
    P_p99_W: float
    P_max_W: float
    energy_unaccounted: float
    """Energy balance error, as a share of the supplied energy."""
    hidden_rms_W: float
    """RMS power of the effects."""
    files: list[str] = field(default_factory=list)
    simulated: bool = True


def execute(settings: LabSettings, source: Path, out: Path, *, waveform: bool = False) -> ExecutionReport:
    """Execute `source` and write rows, log, truth and report to the folder `out`. Raises UserError."""
    late = [effect.id for effect in settings.effects if effect.recording > 1]
    if late:
        raise UserError(f"effect {late[0]}: from=: an execution has only one recording; use at= within it")
    cell = build_cell(settings)
    task = _load(cell, source)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UserError(f"{out} exists and is not an empty folder; choose another --out")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{out}: cannot be made ({error.strerror}); choose another --out") from None
    log = out / (source.stem + log_suffix(cell.robot))
    rows = RowFile(out / "rows.jsonl", cell.device, f"execute-{settings.seed}")
    codes: list[Codes] = []
    complete = False
    try:
        motion, truth = _run(cell, task, log, rows.write, codes.append if waveform else None)
        complete = True
    finally:
        rows.close(complete=complete)
    files = [out / "rows.jsonl", log, _write_truth(out / "truth.json", settings, truth)]
    if waveform:
        files.append(_write_waveform(out / "waveform.npz", codes, settings, timed=True))
    files.append(execution_report(cell, truth, motion.q, out))
    return _report(cell.robot.name, truth, files)


def render(settings: LabSettings, source: Path, folder: Path) -> Path:
    """Write only the 20 kHz waveform of an execution, as an NPZ without a start time. Returns its path."""
    cell = build_cell(settings)
    codes: list[Codes] = []
    _run(cell, _load(cell, source), folder / "robot.log", lambda _: None, codes.append)
    return _write_waveform(folder / "waveform.npz", codes, settings, timed=False)


@dataclass(frozen=True, slots=True)
class _Task:
    """What to execute."""

    name: str
    start: Floats
    """[axes] rad."""
    motion: Callable[[Controller], Motion]


def _load(cell: Cell, source: Path) -> _Task:
    """A program file, a trajectory, or the motion of a robot log; the columns of a table decide. Raises InputError."""
    if source.suffix == ".toml":
        given = read_program(source, cell.robot)
        require_free(cell.checker, given.start, f"the start of {source}", cell.scene.name)
        return _Task(source.stem, given.start, lambda controller: controller.run(list(given.steps)))
    table = read_table(source)
    if table.header is None:  # a trajectory, unless this robot's logs have no header
        is_log = any(not layout.header for layout in cell.robot.log) and table.values.shape[1] != cell.robot.axes
    else:
        is_log = not all(name.endswith("_deg") for name in table.header)
    if not is_log:
        trajectory = read_trajectory(source, cell.robot)
        require_free(cell.checker, trajectory.waypoints[0], f"the first position of {source}", cell.scene.name)
        program = cell.planner.program(trajectory, cell.random(MOTION, 1, 1))
        return _Task(trajectory.name, trajectory.waypoints[0], lambda controller: controller.run(program))
    recorded = read_log(source, cell.robot)
    if recorded.note not in ("", LEFT_OUT):
        raise InputError(source, f"{recorded.note}; remove them")
    motion = motion_of(recorded, cell.robot)
    return _Task(source.stem, motion.q[0], lambda _: motion)


def _run(
    cell: Cell,
    task: _Task,
    log: Path,
    deliver: Callable[[WindowBatch], None],
    keep: Callable[[Codes], None] | None,
) -> tuple[Motion, SessionTruth]:
    session = Session(cell, 0, cell.settings.start_utc_ns, task.start, deliver, keep)
    session.pause([Phase("idle"), Wait(2.0)], 1)
    motion = task.motion(session.controller)
    session.record_motion(motion, 1, task.name, log)
    session.controller.position = motion.q[-1]
    return motion, session.finish()


def _write_waveform(path: Path, parts: list[Codes], settings: LabSettings, *, timed: bool) -> Path:
    """Write the codes of an EL3783 as NPZ (docs/waveforms.md)."""
    codes = np.concatenate(parts)
    form = Mains(settings.mains, settings.random(0)).form
    arrays = {"u_code": codes[:, :1].T, "i_code": codes[:, 1:].T, "simulated": np.array(1)}
    arrays |= {"u_V_per_digit": np.array(form.scale[0]), "i_A_per_digit": np.array(form.scale[1])}
    arrays |= {"fs": np.array(form.rate), "f_nominal": np.array(form.f_nominal)}
    if timed:
        arrays["start_utc_ns"] = np.array(settings.start_utc_ns)
    with naming(path):
        np.savez_compressed(path, allow_pickle=False, **arrays)
    return path


def _write_truth(path: Path, settings: LabSettings, truth: SessionTruth) -> Path:
    content = {
        "simulated": True,
        "settings": settings.model_dump(mode="json"),
        "start_utc_ns": truth.start_utc_ns,
        "window_s": truth.window_s,
        "recordings": [asdict(recording) for recording in truth.recordings],
        "energy": truth.energy,
        "P_W": truth.power,
        "P_without_effects_W": truth.clean_power,
    }
    with naming(path):
        path.write_bytes(orjson.dumps(content, option=orjson.OPT_SERIALIZE_NUMPY))
    return path


def _report(robot: str, truth: SessionTruth, files: list[Path]) -> ExecutionReport:
    recording = truth.recordings[0]
    within = windows_within(recording.start_s, recording.seconds, truth.window_s)
    metered = truth.metered[within]
    hidden = truth.power[within] - truth.clean_power[within]
    return ExecutionReport(
        recording.name,
        robot,
        recording.seconds,
        len(truth.metered),
        float(np.nanmean(metered)),
        float(np.nanpercentile(metered, 99)),
        float(np.nanmax(metered)),
        truth.energy["unaccounted_share"],
        float(np.sqrt(np.mean(hidden**2))),
        [str(path) for path in files],
    )
