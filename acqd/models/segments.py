"""Datasets in memory: segments of valid rows, each with its part of the split."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.dataset.manifest import load_manifest
from acqd.dataset.schema import read_columns
from acqd.dataset.split import Part
from acqd.errors import UserError
from acqd.models.features import continued, derivatives
from acqd.numerics import runs_of_true
from acqd.robot.labels import Texts
from acqd.robot.log_layout import LABELS

_MIN_S = 2.0
SIGNALS = ("brake", "tool")
"""Logged signals that a model may use."""


@dataclass(frozen=True, slots=True)
class Segment:
    """Consecutive rows of one recording, without a gap."""

    recording: str
    source: str
    """Trajectory that was executed."""
    kind: str
    """Kind of the trajectory: "limited", "all" or "other"."""
    split: Part
    q: Floats
    """[T, axes] rad."""
    P: Floats
    """[T] W."""
    tau: Floats | None
    """[T, axes] Nm from torque sensors; None without them."""
    signals: dict[str, Floats]
    """Logged signals [T] by name."""
    start_s: float = 0.0
    """Unix time of the first row, s."""
    channels: dict[str, Floats] = field(default_factory=dict)
    """Further measurements: "Vrms" [T] V; "current" [T, axes] A; "temperature" [T, axes] degC. NaN where unknown."""
    before: Floats | None = None
    """[k, axes] rad: angles of the rows before the first one, of a piece cut out of a motion; None where unknown."""
    after: Floats | None = None
    """[k, axes] rad: likewise after the last one."""
    content: str = ""
    """Hash of the recording's power and angles: the same recording under any name, at any date."""
    labels: dict[str, Texts] = field(default_factory=dict)
    """Numbers [T] of program, step, part and state, where the log had them; NaN where unknown."""
    lag_within_s: float = 0.0
    """Half the width of the 95 % interval of the lag between power and motion, s; 0 for a lag that was given."""
    session: str = ""
    """Of recordings in question from several sessions: each session starts with gears of its own temperature."""
    worked_s: float = 0.0
    """How long the robot had worked when its session began, s: gears are that warm."""

    def around(self, radius: int) -> Floats:
        """Angles [T + 2 radius, axes] rad: the known ones before and after; beyond these the motion fades."""
        before, after = self._context()
        before, after = before[max(0, len(before) - radius) :], after[:radius]
        whole = continued(np.concatenate([before, self.q, after]), radius)
        return whole[len(before) : len(whole) - len(after)]

    def motion(self, step_s: float) -> tuple[Floats, Floats, Floats]:
        """q [rad], qd [rad/s] and qdd [rad/s^2], each [T, axes]."""
        return (self.q, *derivatives(self.around(1), step_s))

    def extended(self) -> tuple[Floats, int, int]:
        """Angles with all that are known before and after, and the number of rows before and after."""
        before, after = self._context()
        return np.concatenate([before, self.q, after]), len(before), len(after)

    def _context(self) -> tuple[Floats, Floats]:
        none = self.q[:0]
        return (none if self.before is None else self.before), (none if self.after is None else self.after)


@dataclass(frozen=True, slots=True)
class Dataset:
    """All segments of a dataset."""

    path: Path
    digest: str
    """SHA-256 of the manifest, which contains the hashes of the inputs."""
    robot: str
    description: str
    """Name or path of the robot description."""
    step_s: float
    measured: str
    """Origin of the power: mains, derived or simulated."""
    segments: list[Segment]

    @property
    def content(self) -> str:
        """Hash of all recordings' power and angles, whatever their names, dates and order."""
        return hashlib.sha256("".join(sorted({segment.content for segment in self.segments})).encode()).hexdigest()

    @property
    def axes(self) -> int:
        """Number of joints."""
        return int(self.segments[0].q.shape[1])

    @property
    def kinds(self) -> list[str]:
        """Kinds of trajectories, sorted."""
        return sorted({segment.kind for segment in self.segments})

    def part(self, split: Part, kinds: tuple[str, ...] = ()) -> list[Segment]:
        """Segments of a part of the split, of some kinds or (empty) all. Raises UserError without any."""
        for kind in kinds:
            if kind not in self.kinds:
                raise UserError(f"{self.path}: has no trajectories {kind!r}; its kinds are {', '.join(self.kinds)}")
        chosen = [s for s in self.segments if s.split == split and (not kinds or s.kind in kinds)]
        if not chosen:
            raise UserError(
                f"{self.path}: no {split} recordings{' of ' + ', '.join(kinds) if kinds else ''}; record at least "
                "three different trajectories: the split is by source trajectory"
            )
        return chosen


def load_dataset(path: Path) -> Dataset:
    """Read the dataset in the folder `path`. Raises UserError, InputError."""
    manifest = load_manifest(path)
    segments: list[Segment] = []
    for entry in manifest["recordings"]:
        segments += _segments(path / entry["file"], entry, manifest["step_s"])
    if not segments:
        raise UserError(f"{path}: no recording has {_MIN_S} s of consecutive valid rows")
    if len({segment.q.shape[1] for segment in segments}) > 1:
        raise UserError(f"{path}: recordings have different numbers of axes; build one dataset per robot")
    digest = hashlib.sha256((path / "manifest.json").read_bytes()).hexdigest()
    return Dataset(
        path, digest, manifest["robot"], manifest["description"], manifest["step_s"], manifest["measured"], segments
    )


def _segments(file: Path, entry: dict[str, object], step_s: float) -> list[Segment]:
    return segments_of(read_columns(file), entry, step_s)


def segments_of(columns: dict[str, NDArray[Any]], entry: dict[str, object], step_s: float) -> list[Segment]:
    """Segments of at least 2 s of merged columns; `entry` gives name, source, kind and split of the recording."""
    axes = sum(1 for name in columns if name[0] == "q" and name[1:].isdigit())
    q = np.column_stack([columns[f"q{k + 1}"] for k in range(axes)])
    tau = np.column_stack([columns[f"tau{k + 1}"] for k in range(axes)]) if "tau1" in columns else None
    good = np.asarray(columns["valid"], dtype=bool) & np.isfinite(q).all(axis=1)
    if tau is not None and not np.isfinite(tau[good]).all():
        tau = None
    content = content_of(columns, q)
    context = np.asarray(columns.get("context", np.zeros(len(q))), dtype=bool)
    segments = []
    for first, last in runs_of_true(good):
        if (last - first) * step_s < _MIN_S:
            continue
        rows, (before, after) = slice(first, last), neighbours(q, context, first, last)
        signals = {name: columns[name][rows] for name in SIGNALS if name in columns}
        part: Part = entry["split"]  # type: ignore[assignment]
        segments.append(
            Segment(
                str(entry["name"]),
                str(entry["source"]),
                str(entry["kind"]),
                part,
                q[rows],
                columns["P"][rows],
                None if tau is None else tau[rows],
                signals,
                float(columns["time_ns"][first]) * 1e-9,
                {name: values[rows] for name, values in _channels(columns, axes).items()},
                before,
                after,
                content,
                labels={name: columns[name][rows] for name in LABELS if name in columns},
                lag_within_s=float(entry.get("lag_within_s") or 0.0),  # type: ignore[arg-type]
                worked_s=60 * float(entry.get("worked_min") or 0.0),  # type: ignore[arg-type]
            )
        )
    return segments


def content_of(columns: dict[str, Floats], q: Floats) -> str:
    """SHA-256 of a recording's power and angles [T, axes]; neither names nor dates count."""
    digest = hashlib.sha256(np.ascontiguousarray(columns["P"], dtype=np.float64).tobytes())
    digest.update(np.ascontiguousarray(q, dtype=np.float64).tobytes())
    return digest.hexdigest()


def neighbours(q: Floats, context: NDArray[np.bool_], first: int, last: int) -> tuple[Floats, Floats]:
    """Angles [k, axes] of the rows before and after a segment of which the angles alone are known."""
    known = context & np.isfinite(q).all(axis=1)
    start, end = first, last
    while start > 0 and known[start - 1]:
        start -= 1
    while end < len(known) and known[end]:
        end += 1
    return q[start:first], q[last:end]


def _channels(columns: dict[str, Floats], axes: int) -> dict[str, Floats]:
    channels = {}
    if "Vrms" in columns and np.isfinite(columns["Vrms"]).any():
        channels["Vrms"] = columns["Vrms"]
    for name in ("current", "temperature"):
        if f"{name}1" in columns:
            channels[name] = np.column_stack([columns[f"{name}{k + 1}"] for k in range(axes)])
    return channels
