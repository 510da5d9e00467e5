"""What is looked at: a model, the recordings in question, and those to compare with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.regression.design_matrix import LEAST_ROWS
from acqd.errors import UserError
from acqd.models.bundle.bundle import Bundle
from acqd.models.bundle.reference import load_reference
from acqd.models.bundle.restore import carrier_of, open_model
from acqd.models.effects import library
from acqd.models.greybox.fit import fit_grey_box
from acqd.models.greybox.model import GreyBox
from acqd.models.predictor import Predictor
from acqd.models.segments import Dataset, Segment, load_dataset
from acqd.robot.description import RobotDescription, load_description

Question = Literal["change", "structure"]
FEWEST_RECORDINGS = 4
LEAST_S = 20.0
_FEWEST_TO_SPARE = 12  # recordings before some are set aside
_SPARED = 0.2


@dataclass(frozen=True, slots=True)
class Subject:
    """See the module."""

    bundle: Bundle
    model: Predictor
    carrier: GreyBox
    """Torques and powers for the effects; all its terms are there, whatever the model lacks."""
    robot: RobotDescription
    data: Dataset
    question: Question
    """Whether there is something to compare with ("change"), or the model itself is in question."""
    fit: list[Segment]
    """Looked at to find effects."""
    held_out: list[Segment]
    """Only to measure errors on, before and after. Not fitted by the model either."""
    reference: list[Segment]
    withheld: frozenset[str]
    chosen: frozenset[str]
    notes: list[str]


def subject_of(order: CloseConfig, progress: Callable[[str, float], None]) -> Subject:
    """Raises UserError, InputError."""
    bundle, model = open_model(order.bundle)
    metadata = bundle.metadata
    data = _since(load_dataset(order.dataset), order.since_s)
    if data.axes != metadata["axes"]:
        raise UserError(
            f"{order.dataset} has {data.axes} axes ({data.robot}), the model {metadata['axes']} ({metadata['robot']}): "
            "take a model of this robot"
        )
    if abs(data.step_s - model.step_s) > 1e-9:
        raise UserError(f"{order.dataset} has rows of {data.step_s} s, the model of {model.step_s} s; build it anew")
    robot = load_description(order.robot or metadata["description"])
    notes: list[str] = []
    trained_on, digest = seen_by(metadata["provenance"])
    same = data.digest == digest
    unseen = [s for s in data.segments if not (same and s.recording in trained_on)]
    recordings = {segment.recording for segment in data.segments if len(segment.P) >= LEAST_ROWS}
    seconds = sum(len(segment.P) for segment in data.segments if len(segment.P) >= LEAST_ROWS) * data.step_s
    if len(recordings) < FEWEST_RECORDINGS or seconds < LEAST_S:
        raise UserError(
            f"{order.dataset}: {len(recordings)} recordings of at least {LEAST_ROWS * data.step_s:.1f} s, "
            f"{seconds:.0f} s together, are too few to tell an effect from chance; "
            f"record at least {FEWEST_RECORDINGS} of a minute each "
            "(or cut one long log: dataset build --cut)"
        )
    reference: list[Segment] = []
    if order.reference is not None:
        before = load_dataset(order.reference)
        if before.axes != data.axes:
            raise UserError(f"{order.reference} is of a robot with {before.axes} axes; name one of {data.robot}")
        reference = before.segments
    elif not same:
        reference = load_reference(order.bundle)
        if not reference:
            notes.append("the bundle remembers no recordings: whether something has changed since cannot be asked")
    if same and not unseen:
        raise UserError(f"{order.dataset}: the model was fitted on all of its recordings; close the loop on new ones")
    fit, held_out = _set_aside(data.segments, unseen, order.seed, same=same)
    withheld = frozenset(metadata.get("withheld", ()))
    carrier = _carrier(bundle, model, robot, reference or fit, data.step_s, order.seed, withheld, progress)
    return Subject(
        bundle, model, carrier, robot, data, "change" if reference else "structure", fit, held_out, reference,
        withheld, _chosen(order), notes,
    )  # fmt: skip


def _since(data: Dataset, since_s: float | None) -> Dataset:
    """Without recordings that ended before. Raises UserError when none is left."""
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


def seen_by(provenance: dict[str, Any]) -> tuple[set[str], str]:
    """Recordings that the model was last fitted on, and the hash of their dataset's manifest."""
    if "closed_manifest_sha256" in provenance:
        return set(provenance["closed_fit_recordings"]), provenance["closed_manifest_sha256"]
    return set(provenance["fit_recordings"]) | set(provenance["validation_recordings"]), provenance["manifest_sha256"]


def _chosen(order: CloseConfig) -> frozenset[str]:
    known = library()
    for name in (*order.only, *order.exclude):
        if name not in known:
            raise UserError(f"no effect {name!r}; there are {', '.join(known)}")
    return frozenset(set(order.only or known) - set(order.exclude))


def _set_aside(
    segments: list[Segment], unseen: list[Segment], seed: int, *, same: bool
) -> tuple[list[Segment], list[Segment]]:
    """Recordings to look at, and whole ones to measure on that nothing was fitted to."""
    if same:
        held_out = unseen
        names = {segment.recording for segment in held_out}
        return [segment for segment in segments if segment.recording not in names], held_out
    names_in_time = sorted(
        {s.recording for s in unseen}, key=lambda n: min(s.start_s for s in unseen if s.recording == n)
    )
    every = round(1 / _SPARED) if len(names_in_time) >= _FEWEST_TO_SPARE else 4
    starts = np.random.default_rng(seed).permutation(every)
    first = max(starts, key=lambda start: _switching(unseen, set(names_in_time[start::every])))
    names = set(names_in_time[first::every])
    return [s for s in unseen if s.recording not in names], [s for s in unseen if s.recording in names]


def _switching(segments: list[Segment], names: set[str]) -> float:
    """How much of what signals switch is in some recordings: an effect that never acts there cannot be judged there."""
    chosen = [segment for segment in segments if segment.recording in names]
    return sum(float(np.abs(np.diff(values)).sum()) for segment in chosen for values in segment.signals.values())


def _carrier(
    bundle: Bundle,
    model: Predictor,
    robot: RobotDescription,
    segments: list[Segment],
    step_s: float,
    seed: int,
    withheld: frozenset[str],
    progress: Callable[[str, float], None],
) -> GreyBox:
    base = getattr(model, "base", model)
    if not withheld and (isinstance(base, GreyBox) or "carrier" in bundle.metadata):
        return carrier_of(bundle, base)
    progress("fitting a grey box to trace with", 0.0)
    fit = fit_grey_box(robot, segments, step_s, seed, lambda share: progress("fitting a grey box to trace with", share))
    return fit.model
