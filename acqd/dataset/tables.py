"""Datasets from and to one Arrow table with the rows of all recordings: for data that were merged elsewhere."""

from __future__ import annotations

import hashlib
import re
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import orjson
import pyarrow as pa
from numpy.typing import NDArray

from acqd import __version__
from acqd.dataset.arrow import UTC_NS, recording_table
from acqd.dataset.column_check import judge_table
from acqd.dataset.growing import write_new
from acqd.dataset.log_check import SLOWEST_S, check_signals
from acqd.dataset.manifest import load_manifest
from acqd.dataset.merge import Recording
from acqd.dataset.motion_notes import end_notes, motion_notes
from acqd.dataset.power import Measured
from acqd.dataset.power_values import no_value_note, no_values
from acqd.dataset.schema import TIME, read_columns, unit_of
from acqd.dataset.split import with_split
from acqd.dataset.table_motion import require_power, trusted_motion, without_unusable
from acqd.dataset.unaligned import clock_doubts, log_of, pair_of
from acqd.errors import UserError
from acqd.robot.columns import on_off
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.labels import from_cells
from acqd.robot.log_ends import unknown_ends
from acqd.robot.log_layout import LABELS
from acqd.robot.motion_quality import MotionQuality

RECORDING = "recording"
_IGNORED = (RECORDING, TIME, "split", "valid", "context")
_STEP_ERROR = 0.02  # of a step, by which a row may be early or late
_CLOCK_REMEDY = "shift the power by that, or let acqd dataset build align logs and power"
_NAME = re.compile(r"[\w.+-]{1,120}")


def table_of(dataset: Path) -> pa.Table:
    """All recordings below each other: `recording`, `split`, `time`, and the columns that all of them have.

    Raises UserError, InputError.
    """
    parts = []
    for entry in load_manifest(dataset)["recordings"]:
        columns = read_columns(dataset / entry["file"])
        columns.pop("context", None)
        table = recording_table(columns.pop("time_ns"), columns)
        for name in ("split", RECORDING):
            table = table.add_column(0, name, pa.array([str(entry.get(name, entry["name"]))] * len(table)))
        parts.append(table)
    common = [name for name in parts[0].column_names if all(name in part.column_names for part in parts)]
    return pa.concat_tables([part.select(common) for part in parts])


def write_table(table: pa.Table, out: Path, robot: str, measured: Measured, seed: int = 1) -> None:
    """The dataset `out` of a table with `recording`, `time` (timestamp), `P` [W], `q1`.. [rad] and more, row by row.

    Rows of a recording are equidistant, with the same step in all of them; the split is by source trajectory unless
    a column `split` names it. Raises UserError for anything else, OperationError when it cannot be written.
    """
    description = load_description(robot)
    if measured not in get_args(Measured):
        raise UserError(f"measured {measured!r}: expected {', '.join(get_args(Measured))}")
    if out.exists():
        raise UserError(f"{out} exists; choose another folder, or remove it")
    _require_columns(table, description)
    recordings, steps, parts, qualities = [], [], [], []
    for name in dict.fromkeys(table[RECORDING].to_pylist()):
        rows = table.filter(pa.compute.equal(table[RECORDING], name))
        recording, step_ns, quality = _recording(str(name), rows, description)
        recordings.append(recording)
        steps.append(step_ns)
        qualities.append(quality)
        parts.append(_part(str(name), rows))
    step_s = float(np.median(steps)) * 1e-9
    wrong = [r.name for r, step in zip(recordings, steps, strict=True) if abs(step * 1e-9 - step_s) > 1e-6]
    if wrong:
        raise UserError(f"recording {wrong[0]}: another step than {step_s:.6g} s; resample all recordings to one step")
    notes = _without_no_values(recordings)
    P, valid = (np.concatenate(each) for each in zip(*((r.columns["P"], r.valid) for r in recordings), strict=True))
    if not valid.any():
        raise UserError("the table has no valid rows")
    require_power(P, valid, step_s * 1e9, description)
    notes += _motion_notes(recordings, description.axes, step_s)
    logs = [
        replace(log_of(each, description), quality=found) for each, found in zip(recordings, qualities, strict=True)
    ]
    for log in logs:
        check_signals(log, description)
    pairs = [pair_of(each, description, step_s) for each in recordings]
    doubts = clock_doubts(pairs, description, lambda _: _CLOCK_REMEDY)
    notes += doubts + judge_table(recordings, description, by_power=not doubts)
    entries = [
        _entry(recording, part, step_s) | {"motion": quality.as_json() | {"unknown_ends": recording.unknown_ends}}
        for recording, part, quality in zip(recordings, parts, qualities, strict=True)
    ]
    manifest = {
        "acqd": __version__,
        "robot": description.name,
        "description": str(Path(robot).resolve()) if Path(robot).is_file() else robot,
        "measured": measured,
        "step_s": step_s,
        "power": {"origin": "table"},
        "version": 1,
        "refused": [],
        "recordings": with_split(entries, seed),
    }

    def fill(folder: Path) -> None:
        (folder / "recordings").mkdir()
        for recording in recordings:
            recording.write(folder / "recordings", description.sliding)

    write_new(out, orjson.dumps(manifest, option=orjson.OPT_INDENT_2), fill)
    for note in [*notes, *motion_notes(logs), *end_notes(recordings, step_s)]:
        warnings.warn(note, UserWarning, stacklevel=3)


def _motion_notes(recordings: list[Recording], axes: int, step_s: float) -> list[str]:
    """Lines on rows that are far apart, and on angles that never change."""
    notes = []
    if step_s > SLOWEST_S:
        notes.append(
            f"rows are {step_s:.3g} s apart: accelerations between them are not known; use 0.04 s where you can"
        )
    if all(np.ptp(each.of_axes("q", axes)[each.valid], axis=0).max(initial=0.0) == 0.0 for each in recordings):
        notes.append("no angle changes in any recording: the robot stands still, or its angles are not measured")
    return notes


def _without_no_values(recordings: list[Recording]) -> list[str]:
    """Makes rows invalid whose power is a number that stands for no value; a line that says so."""
    P = np.concatenate([recording.columns["P"] for recording in recordings])
    nothing = no_values(P)
    if nothing is None:
        return []
    for recording in recordings:
        recording.valid[recording.columns["P"] == nothing[1]] = False
    return [f"power: {no_value_note(int(nothing[0].sum()), len(P), nothing[1])}"]


def _part(name: str, rows: pa.Table) -> str | None:
    """The part of the split that all rows of a recording name; None without a column. Raises UserError."""
    if "split" not in rows.column_names:
        return None
    parts = list(dict.fromkeys(rows["split"].to_pylist()))
    if len(parts) > 1:
        named = ", ".join(str(part) for part in parts)
        raise UserError(f"recording {name}: its rows are in several parts of the split ({named}); expected one")
    return None if parts[0] is None else str(parts[0])


def _require_columns(table: pa.Table, robot: RobotDescription) -> None:
    needed = [RECORDING, TIME, "P", *(f"q{k + 1}" for k in range(robot.axes))]
    twice = [name for name in table.column_names if table.column_names.count(name) > 1]
    if twice:
        raise UserError(f"the table has several columns {twice[0]!r}; expected one: rename or remove the others")
    missing = [name for name in needed if name not in table.column_names]
    if missing:
        raise UserError(f"the table lacks {', '.join(missing)}: {robot.name} needs {', '.join(needed)}")
    further = f"q{robot.axes + 1}"
    if further in table.column_names:
        raise UserError(
            f"the table has a column {further}, but {robot.name} has {robot.axes} joints: is it a table of another "
            "robot? Rename the column if it is no joint of this arm"
        )
    if not len(table):
        raise UserError("the table has no rows")
    if not pa.types.is_timestamp(table.schema.field(TIME).type) or table.schema.field(TIME).type.tz is None:
        raise UserError(
            "column time: expected timestamps with a time zone, such as pandas.to_datetime(seconds, unit='s', "
            "utc=True), or series.dt.tz_localize('Europe/Berlin') for local times"
        )
    for name in (TIME, RECORDING):
        if table[name].null_count:
            row = table[name].is_null().to_pylist().index(True) + 1
            raise UserError(f"column {name}: row {row} has none; {table[name].null_count} rows lack it: remove them")


def _recording(name: str, rows: pa.Table, robot: RobotDescription) -> tuple[Recording, float, MotionQuality]:
    """One recording, its step [ns], and what was found in its motion. Raises UserError."""
    if not _NAME.fullmatch(name):
        raise UserError(f"recording {name!r}: expected a name of letters, digits and . _ + -")
    time_ns = rows[TIME].cast(UTC_NS).cast(pa.int64()).to_numpy()
    if len(time_ns) < 3:
        raise UserError(f"recording {name}: has {len(time_ns)} rows, expected at least three")
    steps = np.diff(time_ns)
    step_ns = float(np.median(steps))
    if not (steps > 0).all():
        row = int((steps <= 0).argmax()) + 2
        raise UserError(
            f"recording {name}: row {row} is not later than the row before; sort by time, without duplicates"
        )
    uneven = np.flatnonzero(np.abs(steps - step_ns) > _STEP_ERROR * step_ns)
    if len(uneven):
        row = int(uneven[0]) + 2
        raise UserError(
            f"recording {name}: row {row} is not {step_ns * 1e-9:.6g} s after the row before; resample it to one step"
        )
    used = [name for name in rows.column_names if name not in _IGNORED and _used(name, rows)]
    columns = {name: _numbers(name, rows) for name in used if name not in LABELS}
    labels = {name: from_cells(rows[name].to_pylist()) for name in used if name in LABELS}
    essential = [columns["P"], *(columns[f"q{k + 1}"] for k in range(robot.axes))]
    valid = np.asarray(np.isfinite(np.array(essential)).all(axis=0))
    if "valid" in rows.column_names:
        valid &= _flags(rows)
    angles = [f"q{k + 1}" for k in range(robot.axes)]
    q = np.column_stack([columns[angle] for angle in angles])
    try:
        q, known, quality = trusted_motion((time_ns - time_ns[0]) * 1e-9, q, robot)
    except ValueError as error:
        raise UserError(f"recording {name}: {error}") from None
    columns |= dict(zip(angles, q.T, strict=True))
    quality = without_unusable(columns, time_ns, q, known, robot, quality)
    quality = replace(quality, unusable=(*quality.unusable, *_other_levels(columns)))
    ends = valid & unknown_ends(q, known, step_ns * 1e-9)
    valid &= known & ~ends
    context = known & ~valid
    known_angles = context if context.any() else None
    recording = Recording(name, time_ns, columns, valid, known_angles, int(ends.sum()), labels)
    return recording, step_ns, quality


def _other_levels(columns: dict[str, NDArray[np.float64]]) -> list[str]:
    """Makes `tool` and `brake` 0 and 1; removes those with other values, and names them."""
    found = []
    for name in ("tool", "brake"):
        if name in columns:
            levels = on_off(columns.pop(name))
            if levels is None:
                found.append(f"{name} holds other values than 0 and 1")
            else:
                columns[name] = levels
    return found


def _flags(rows: pa.Table) -> NDArray[np.bool_]:
    """The column `valid` [T]: booleans, 0 and 1, or the words. Raises UserError for anything else."""
    cells = rows["valid"].to_pylist()
    known = {True: True, False: False, "true": True, "false": False, "1": True, "0": False, None: False}
    words = [cell.strip().lower() if isinstance(cell, str) else cell for cell in cells]
    wrong = next((cell for cell, word in zip(cells, words, strict=True) if word not in known), None)
    if wrong is not None:
        raise UserError(f"column valid: holds {wrong!r:.40}; expected booleans, or 0 and 1")
    return np.array([known[word] for word in words])


def _used(name: str, rows: pa.Table) -> bool:
    """Whether a column is kept: words in a column that no part of acqd reads do not matter."""
    kind = rows.schema.field(name).type
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    words = pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_temporal(kind)
    return not words or unit_of(name) is not None or name in LABELS


def _numbers(name: str, rows: pa.Table) -> np.ndarray:
    try:
        return np.asarray(rows[name].cast(pa.float64()).to_numpy(zero_copy_only=False))
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError) as error:
        if pa.types.is_string(rows.schema.field(name).type) or pa.types.is_large_string(rows.schema.field(name).type):
            raise UserError(f"column {name}: holds text, expected numbers: {str(error).splitlines()[0]}") from None
        raise UserError(f"column {name}: holds {rows.schema.field(name).type}, expected numbers") from None


def _entry(recording: Recording, part: str | None, step_s: float) -> dict[str, Any]:
    digest = hashlib.sha256(recording.time_ns.tobytes() + recording.columns["P"].tobytes()).hexdigest()
    entry = {
        "name": recording.name,
        "file": f"recordings/{recording.name}.parquet",
        "rows": len(recording.valid),
        "context_rows": 0 if recording.context is None else int(recording.context.sum()),
        "valid_s": float(recording.valid.sum()) * step_s,
        "lag_s": 0.0,
        "lag_within_s": None,
        "lag_by": "table",
        "own_lag": {"s": 0.0, "r2": 1.0, "stands_out": 1.0},
        "note": "",
        "log": {"path": recording.name, "sha256": digest, "rows": len(recording.valid)},
    }
    if part is None:
        return entry
    if part not in ("train", "validation", "test"):
        raise UserError(f"recording {recording.name}: split {part!r}, expected train, validation or test")
    return entry | {"split": part, "source": recording.name}
