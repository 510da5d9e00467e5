"""A model, the recordings in question (fit and held out), and the reference recordings."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.overlaps import without_shared_rows
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.errors import UserError
from acqd.models.bundle.bundle import Bundle
from acqd.models.bundle.reference import load_reference
from acqd.models.bundle.restore import carrier_of, open_model
from acqd.models.effects import library
from acqd.models.effects.substeps import RADIUS
from acqd.models.greybox.fit import fit_grey_box
from acqd.models.greybox.model import GreyBox
from acqd.models.predictor import Predictor
from acqd.models.segments import Dataset, Segment, load_dataset
from acqd.models.yearly import moving_rows, require_duty
from acqd.robot.description import RobotDescription, load_description

_ROUNDING = 1e-9
"""rad or m: what interpolation leaves of a constant angle."""
Question = Literal["change", "structure"]
"""What has changed since the reference; what the model lacks in all recordings."""


@dataclass(frozen=True, slots=True)
class Subject:
    """What the loop works on."""

    bundle: Bundle
    model: Predictor
    carrier: GreyBox
    """Grey box with all terms, for torques and powers of the effects; the model itself may lack some."""
    robot: RobotDescription
    data: Dataset
    question: Question
    fit: list[Segment]
    """Recordings in which effects are searched."""
    held_out: list[Segment]
    """Recordings for the errors before and after; neither the model nor an effect is fitted to them."""
    reference: list[Segment]
    withheld: frozenset[str]
    """Groups of parameters that the grey box was denied."""
    chosen: frozenset[str]
    """Ids of effects that compete."""
    notes: list[str]

    @property
    def fit_s(self) -> float:
        """Duration of the recordings in which effects are searched, s."""
        return sum(len(segment.P) for segment in self.fit) * self.data.step_s

    @property
    def begins(self) -> dict[str, float]:
        """UTC of the start of the sessions in question by name, s; a session may begin with a held-out recording."""
        return {s.session: s.start_s for s in sorted([*self.fit, *self.held_out], key=lambda s: -s.start_s)}


def subject_of(config: CloseConfig, progress: Callable[[str, float], None]) -> Subject:
    """Open the model and the datasets. Raises UserError, InputError."""
    bundle, model = open_model(config.bundle)
    data, copies = _without_copies(_since(_together(config), config.since_s))
    _require_same_robot(config, bundle, model, data)
    robot = load_description(config.robot or bundle.metadata["description"])
    strangers = _strangers(config, bundle, data, robot)
    provenance = bundle.metadata["provenance"]
    same = is_training_dataset(provenance, data)
    reference, notes = _reference(config, data, same=same)
    data, shared = _without_shared_rows(data, reference)
    unseen, remarks = _unseen(provenance, data)
    remarks += _unmoved_joints(data, reference)
    remarks += _trained_sessions(config, data, unseen)
    _require_enough(config, data, data.segments if same else unseen or data.segments)
    if not unseen:
        raise UserError(f"{config.dataset}: the model was fitted on all of its recordings; close the loop on new ones")
    fit, held_out = _hold_out(data.segments, unseen, same=same)
    require_duty(config.duty, [moving_rows(segment, data.step_s) for segment in held_out], config.dataset)
    withheld = frozenset(bundle.metadata.get("withheld", ()))
    carrier = carrier_in(bundle, model) if not withheld else None
    if carrier is None:
        what = "fitting a grey box for the effects"
        progress(what, 0.0)
        segments = reference or fit
        carrier = fit_grey_box(robot, segments, data.step_s, config.seed, lambda share: progress(what, share)).model
    return Subject(
        bundle=bundle, model=model, carrier=carrier, robot=robot, data=data,
        question="change" if reference else "structure", fit=fit, held_out=held_out, reference=reference,
        withheld=withheld, chosen=_chosen(config), notes=[*strangers, *copies, *shared, *remarks, *notes],
    )  # fmt: skip


def _together(config: CloseConfig) -> Dataset:
    """All datasets in question as one. Raises UserError, InputError."""
    data = load_dataset(config.dataset)
    if not config.further:
        return data
    parts, folders = [data], [config.dataset]
    for path in config.further:
        if any(path.resolve() == other.resolve() for other in folders):
            raise UserError(f"--with {path}: these recordings are in question already; name other recordings")
        folders.append(path)
        more = load_dataset(path)
        for what, own, other in (
            ("robot", data.robot, more.robot), ("step_s", data.step_s, more.step_s),
            ("axes", data.axes, more.axes), ("power", data.measured, more.measured),
        ):  # fmt: skip
            if own != other:
                raise UserError(f"--with {path}: {what} {other}, but {config.dataset} has {own}; name like recordings")
        parts.append(more)
    segments = [
        replace(segment, session=f"session {k}", recording=f"s{k} {segment.recording}" if k else segment.recording)
        for k, part in enumerate(parts) for segment in part.segments
    ]  # fmt: skip
    digest = hashlib.sha256("".join(part.digest for part in parts).encode()).hexdigest()
    return replace(data, digest=digest, segments=segments)


def _trained_sessions(config: CloseConfig, data: Dataset, unseen: list[Segment]) -> list[str]:
    """Notes of recordings of later sessions that the model was fitted on. Raises UserError where none is new."""
    notes = []
    for number, path in enumerate(config.further, 1):
        own = {s.recording for s in data.segments if s.session == f"session {number}"}
        new = {s.recording for s in unseen if s.session == f"session {number}"}
        if not new:
            raise UserError(
                f"--with {path}: the model was fitted on all of its recordings, or its reference holds them; "
                "name those made since"
            )
        if own - new:
            notes.append(f"{len(own - new)} of {len(own)} recordings of {path} were part of the training; left out")
    return notes


def _require_same_robot(config: CloseConfig, bundle: Bundle, model: Predictor, data: Dataset) -> None:
    if data.axes != bundle.metadata["axes"]:
        raise UserError(
            f"{config.dataset} has {data.axes} axes ({data.robot}), the model has {bundle.metadata['axes']} "
            f"({bundle.metadata['robot']}): use a model of this robot"
        )
    if abs(data.step_s - model.step_s) > 1e-9:
        raise UserError(
            f"{config.dataset} has rows of {data.step_s} s, the model has rows of {model.step_s} s; "
            "build the dataset again with the model's step"
        )


def _strangers(config: CloseConfig, bundle: Bundle, data: Dataset, robot: RobotDescription) -> list[str]:
    """A note where description, dataset and model name different robots.

    Names may differ for a reason, such as a corrected description under a new name: then `--robot` says which one
    holds. Raises UserError without `--robot`, and for another number of axes.
    """
    if robot.axes != data.axes:
        raise UserError(
            f"{robot.name} has {robot.axes} axes, {config.dataset} has {data.axes}: describe {data.robot} (--robot)"
        )
    names = {"description": robot.name, "dataset": data.robot, "model": str(bundle.metadata["robot"])}
    if len(set(names.values())) == 1:
        return []
    which = ", ".join(f"the {what} is of {name}" for what, name in names.items())
    if config.robot is None:
        raise UserError(f"{which}: use a model of this robot, or say with --robot which description holds for both")
    return [f"{which}: masses, limits and sizes are those of {robot.name}; is that meant?"]


def _unseen(provenance: dict[str, Any], data: Dataset) -> tuple[list[Segment], list[str]]:
    """Segments that no fit has seen, and notes.

    A model that was closed on later recordings may be asked about those of its training again: only its last fit
    counts then, because the effects were fitted there.
    """
    trained_on = trained_recordings(provenance, data)
    unseen = [segment for segment in data.segments if segment.content not in trained_on]
    enough = len({segment.recording for segment in unseen}) >= THRESHOLDS.fewest_recordings
    if enough or not _last_fit(provenance) or is_training_dataset(provenance, data):
        return unseen, []
    last = set(provenance.get("closed_seen_content", ()))
    since = [segment for segment in data.segments if segment.content not in last]
    return since, ["the training of the model has seen these recordings; the fit of its effects has not"]


def _require_enough(config: CloseConfig, data: Dataset, segments: list[Segment]) -> None:
    least = _least_rows()
    long_enough = [segment for segment in segments if len(segment.P) >= least]
    recordings = {segment.recording for segment in long_enough}
    seconds = sum(len(segment.P) for segment in long_enough) * data.step_s
    if len(recordings) < THRESHOLDS.fewest_recordings or seconds < THRESHOLDS.shortest_total_s:
        more = f"record at least {THRESHOLDS.fewest_recordings} recordings of a minute each"
        if seconds >= max(THRESHOLDS.shortest_total_s, THRESHOLDS.fewest_recordings * least * data.step_s):
            more = "they are long enough together: build the dataset again with --cut auto, which cuts them into pieces"
        raise UserError(
            f"{config.dataset}: {len(recordings)} recordings of at least {least * data.step_s:.1f} s, "
            f"{seconds:.0f} s together, are too few to distinguish an effect from chance; {more}"
        )


def _unmoved_joints(data: Dataset, reference: list[Segment]) -> list[str]:
    """A note of joints without any change of angle, not even noise, that move in the reference."""
    now, then = (np.concatenate([s.q for s in each]) for each in (data.segments, reference or data.segments))
    joints = np.flatnonzero((np.ptp(now, axis=0) <= _ROUNDING) & (np.ptp(then, axis=0) > _ROUNDING)) + 1
    if not len(joints):
        return []
    names = ", ".join(f"q{joint}" for joint in joints)
    return [f"{names}: one angle in all rows in question, but not in the reference; is the column measured?"]


def _least_rows() -> int:
    """Of a segment: a block, and the motion around it."""
    return THRESHOLDS.block_least_rows + 2 * RADIUS + 1


def _reference(config: CloseConfig, data: Dataset, *, same: bool) -> tuple[list[Segment], list[str]]:
    """Recordings to compare with, and notes. Raises UserError, InputError."""
    if config.reference is not None:
        before = load_dataset(config.reference)
        if before.axes != data.axes:
            raise UserError(
                f"{config.reference} is from a robot with {before.axes} axes; name a dataset of {data.robot}"
            )
        return before.segments, []
    if same:
        return [], []
    reference = load_reference(config.bundle)
    lacking = (
        f"{config.bundle} has no reference.safetensors, so that changes since the training cannot be found: what "
        "follows is what the model lacks in all recordings; name recordings from before the change (--reference DS)"
    )
    return reference, [] if reference else [lacking]


def _since(data: Dataset, since_s: float | None) -> Dataset:
    """Without recordings that ended before. Raises UserError when no recording remains."""
    if since_s is None:
        return data
    ends: dict[str, float] = {}
    for segment in data.segments:
        end = segment.start_s + len(segment.P) * data.step_s
        ends[segment.recording] = max(ends.get(segment.recording, end), end)
    kept = [segment for segment in data.segments if ends[segment.recording] > since_s]
    if not kept:
        last = datetime.fromtimestamp(max(ends.values()), UTC).isoformat(timespec="seconds")
        raise UserError(f"{data.path}: no recording since then, the last one ends {last}")
    return replace(data, segments=kept)


def _without_copies(data: Dataset) -> tuple[Dataset, list[str]]:
    """Every recording once, and a note: copies of a recording at other times would count as evidence."""
    first: dict[str, str] = {}
    for segment in sorted(data.segments, key=lambda each: (each.start_s, each.recording)):
        first.setdefault(segment.content, segment.recording)
    kept = [segment for segment in data.segments if first[segment.content] == segment.recording]
    left = sorted({segment.recording for segment in data.segments} - {segment.recording for segment in kept})
    if not left:
        return data, []
    return replace(data, segments=kept), [
        f"{', '.join(left)}: same power and angles as an earlier recording of {data.path}; left out"
    ]


def _without_shared_rows(data: Dataset, reference: list[Segment]) -> tuple[Dataset, list[str]]:
    """Without rows that an earlier recording or the reference holds, and a note. Raises UserError without others."""
    segments, lines = without_shared_rows(data.segments, reference, data.step_s, _least_rows())
    if not segments:
        raise UserError(f"{data.path}: the reference holds all of its power rows; close the loop on later recordings")
    return (replace(data, segments=segments), lines) if lines else (data, [])


def is_training_dataset(provenance: dict[str, Any], data: Dataset) -> bool:
    """Whether the model was last fitted on this dataset: the same file, or the same recordings under any name."""
    prefix = _last_fit(provenance)
    same_file = bool(provenance[f"{prefix}manifest_sha256"] == data.digest)
    return same_file or provenance.get(f"{prefix}dataset_content") == data.content


def trained_recordings(provenance: dict[str, Any], data: Dataset) -> set[str]:
    """Contents of the recordings of `data` that the model was fitted on: by the training, or by the loop since.

    A bundle of before knows names only, which count in the dataset of its last fit.
    """
    prefix = _last_fit(provenance)
    if f"{prefix}seen_content" in provenance:
        seen = {*provenance.get("seen_content", ()), *provenance.get("closed_seen_content", ())}
        return seen & {segment.content for segment in data.segments}
    if not is_training_dataset(provenance, data):
        return set()
    names = {*provenance[f"{prefix}fit_recordings"], *([] if prefix else provenance["validation_recordings"])}
    return {segment.content for segment in data.segments if segment.recording in names}


def _last_fit(provenance: dict[str, Any]) -> str:
    """Prefix of the keys about the last fit: of the loop, or else of the training."""
    return "closed_" if "closed_manifest_sha256" in provenance else ""


def _chosen(config: CloseConfig) -> frozenset[str]:
    known = library()
    for name in (*config.only, *config.exclude):
        if name not in known:
            raise UserError(f"no effect {name!r}; the effects are {', '.join(known)}")
    chosen = frozenset(set(config.only or known) - set(config.exclude))
    if not chosen:
        raise UserError("--only and --exclude leave no effect to search for")
    return chosen


def _hold_out(segments: list[Segment], unseen: list[Segment], *, same: bool) -> tuple[list[Segment], list[Segment]]:
    """Recordings for the search, and whole held-out recordings.

    In the model's own dataset, the model's test recordings are held out. In a new dataset, every fourth recording
    is held out. The first one of them is chosen such that no session is held out as a whole, because effects are not
    searched in held-out recordings, and that signals switch among them: no chance decides.
    """
    if same:
        names = {segment.recording for segment in unseen}
        return [segment for segment in segments if segment.recording not in names], unseen
    starts: dict[str, float] = {}
    sessions: dict[str, set[str]] = {}
    for segment in unseen:
        starts[segment.recording] = min(segment.start_s, starts.get(segment.recording, np.inf))
        sessions.setdefault(segment.session, set()).add(segment.recording)
    in_time = sorted(sorted(starts), key=lambda name: starts[name])
    every = THRESHOLDS.held_out_every

    def worth(start: int) -> tuple[int, float]:
        names = set(in_time[start::every])
        return -sum(own <= names for own in sessions.values()), _switching(unseen, names)

    names = set(in_time[max(range(every), key=worth) :: every])
    return [s for s in unseen if s.recording not in names], [s for s in unseen if s.recording in names]


def _switching(segments: list[Segment], names: set[str]) -> float:
    """Number of switchings of all signals in some recordings: an effect that never acts there cannot be judged."""
    chosen = [segment for segment in segments if segment.recording in names]
    return sum(float(np.abs(np.diff(values)).sum()) for segment in chosen for values in segment.signals.values())


def carrier_in(bundle: Bundle, model: Predictor) -> GreyBox | None:
    """The grey box that the bundle holds; None for a network without one."""
    base = getattr(model, "base", model)
    return carrier_of(bundle, base) if isinstance(base, GreyBox) or "carrier" in bundle.metadata else None
