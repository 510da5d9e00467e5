"""Errors of every model on every kind of held-out recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.models.bundle.bundle import is_bundle
from acqd.models.bundle.restore import open_model
from acqd.models.compare.baselines import constant, linear_physics
from acqd.models.compare.stability import unstable_share
from acqd.models.metrics import Metrics, measure, predictions
from acqd.models.noise_floor import MAE_PER_RMS, noise_floor
from acqd.models.predictor import Predictor
from acqd.models.segments import Dataset, Segment

_RESAMPLES = 500
_AVERAGED = ("mae", "rmse", "bias", "r2", "energy_p95")


@dataclass(frozen=True, slots=True)
class _Member:
    """One trained seed of a model."""

    metadata: dict[str, Any]
    """bundle.json; empty for a baseline."""
    model: Predictor | None
    """None for a baseline."""
    predicted: list[Floats]
    """Power [T] W of each test segment."""


@dataclass(frozen=True, slots=True)
class _Group:
    """Bundles that differ in their seed only."""

    name: str
    trained_on: str
    settings: str
    """Training settings as JSON."""


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """One model, averaged over its seeds."""

    name: str
    trained_on: str
    """Kinds of trajectories, or "everything"."""
    seeds: int
    metrics: dict[str, Metrics]
    """By test set: "everything" and each kind of trajectory."""
    mae_ci95: tuple[float, float]
    """95 % interval of the MAE on everything in W, over source trajectories and seeds."""
    unstable: float
    """Share of seconds in which the prediction oscillates (see `stability`)."""
    errors: Floats
    """Absolute errors [rows] W on everything, of the first seed."""
    predicted: list[Floats]
    """Power [T] W of each test segment, of the first seed."""
    model: Predictor | None
    """Of the first seed; None for baselines."""
    metadata: dict[str, Any]
    """bundle.json of the first seed; empty for baselines."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Models and baselines on the same test recordings."""

    data: Dataset
    test: list[Segment]
    entries: list[Entry]
    baselines: list[Entry]
    floor_W: float
    """MAE of the noise, W: the RMS of `noise_floor` times sqrt(2 / pi)."""
    floor_where: str
    """Where the noise was measured."""
    notes: list[str]

    @property
    def kinds(self) -> list[str]:
        """Test sets: every kind of trajectory, and "everything"."""
        return [*self.data.kinds, "everything"] if len(self.data.kinds) > 1 else ["everything"]

    def best(self) -> Entry:
        """The model with the lowest MAE on everything."""
        return min(self.entries, key=lambda entry: entry.metrics["everything"].mae)

    def find(self, name: str, trained_on: str) -> Entry | None:
        """The model of that name and training data."""
        return next((e for e in self.entries if (e.name, e.trained_on) == (name, trained_on)), None)


def compare(data: Dataset, models: Path, progress: Callable[[str, float], None]) -> Comparison:
    """Evaluate the bundles in the folder `models` on the test recordings of `data`. Raises UserError."""
    test, training = data.part("test"), data.part("train")
    groups, notes = _grouped(data, models, test, progress)
    entries = []
    for group, members in groups.items():
        alike = [other for other in groups if (other.name, other.trained_on) == (group.name, group.trained_on)]
        name = group.name if len(alike) == 1 else f"{group.name} ({_difference(group, alike)})"
        entries.append(_entry(name, group.trained_on, list(members.values()), data, test))
    baselines = {"constant": constant(training, test), "linear physics": linear_physics(training, test, data.step_s)}
    references = [
        _entry(name, "everything", [_Member({}, None, predicted)], data, test) for name, predicted in baselines.items()
    ]
    floor, where = noise_floor(data.segments, data.step_s)
    return Comparison(data, test, entries, references, MAE_PER_RMS * floor, where, notes)


def _grouped(
    data: Dataset, models: Path, test: list[Segment], progress: Callable[[str, float], None]
) -> tuple[dict[_Group, dict[int, _Member]], list[str]]:
    """Predictions of all usable bundles by group and seed, and notes on the others. Raises UserError."""
    paths = sorted(_bundles(models))
    if not paths:
        raise UserError(f"{models}: no bundles there; acqd train writes them")
    groups: dict[_Group, dict[int, _Member]] = {}
    notes: list[str] = []
    for number, path in enumerate(paths, start=1):
        bundle, model = open_model(path)
        metadata = bundle.metadata
        obstacle = _obstacle(metadata, data, test)
        if obstacle:
            notes.append(f"{path.name}: left out, {obstacle}")
            continue
        if metadata["provenance"]["manifest_sha256"] != data.digest:
            notes.append(f"{path.name}: trained on another dataset")
        members = groups.setdefault(_group_of(metadata, data), {})
        seed = metadata["training"]["seed"]
        if seed in members:
            notes.append(f"{path.name}: left out, the same seed was trained twice")
            continue
        members[seed] = _Member(metadata, model, predictions(model, test))
        progress(path.name, number / len(paths))
    if not groups:
        raise UserError(f"{models}: no bundle fits this dataset; {notes[0]}")
    return groups, notes


def _obstacle(metadata: dict[str, Any], data: Dataset, test: list[Segment]) -> str:
    """Why a bundle cannot be compared on `test`; empty if it can."""
    if metadata["robot"] != data.robot or metadata["axes"] != data.axes or metadata["step_s"] != data.step_s:
        return f"it is for {metadata['robot']} at {metadata['step_s']} s"
    provenance = metadata["provenance"]
    if "seen_content" in provenance:
        seen = set(provenance["seen_content"]) & {segment.content for segment in test}
    else:  # a bundle of before: by name
        fitted = provenance["fit_recordings"] + provenance["validation_recordings"]
        seen = set(fitted) & {segment.recording for segment in test}
    return f"it was trained on {len(seen)} of the test recordings" if seen else ""


def _group_of(metadata: dict[str, Any], data: Dataset) -> _Group:
    kinds = "+".join(metadata["training"]["kinds"])
    settings = orjson.dumps(metadata.get("settings"), option=orjson.OPT_SORT_KEYS).decode()
    return _Group(metadata["name"], "everything" if kinds == "+".join(data.kinds) else kinds, settings)


def _difference(group: _Group, alike: list[_Group]) -> str:
    """Settings in which a group differs from others of the same network, such as "epochs 200"."""
    settings, others = orjson.loads(group.settings) or {}, [orjson.loads(other.settings) or {} for other in alike]
    differing = [key for key in settings if any(other.get(key) != settings[key] for other in others)]
    return ", ".join(f"{key} {settings[key]}" for key in differing) or "other settings"


def _bundles(models: Path) -> Iterator[Path]:
    if is_bundle(models):
        yield models
    elif models.is_dir():
        yield from (path for path in models.iterdir() if not path.name.startswith(".") and is_bundle(path))


def _entry(name: str, trained_on: str, members: list[_Member], data: Dataset, test: list[Segment]) -> Entry:
    metrics = {"everything": _mean([measure(member.predicted, test) for member in members])}
    for kind in data.kinds if len(data.kinds) > 1 else []:
        rows = [k for k, segment in enumerate(test) if segment.kind == kind]
        if rows:
            segments = [test[k] for k in rows]
            metrics[kind] = _mean([measure([member.predicted[k] for k in rows], segments) for member in members])
    first = members[0]
    return Entry(
        name,
        trained_on,
        len(members),
        metrics,
        _interval([member.predicted for member in members], test),
        float(np.mean([unstable_share(member.predicted, test) for member in members])),
        np.concatenate([np.abs(power - s.P) for power, s in zip(first.predicted, test, strict=True)]),
        first.predicted,
        first.model,
        first.metadata,
    )


def _mean(metrics: list[Metrics]) -> Metrics:
    """Mean over seeds."""
    mae, rmse, bias, r2, energy = (float(np.mean([getattr(one, name) for one in metrics])) for name in _AVERAGED)
    return replace(metrics[0], mae=mae, rmse=rmse, bias=bias, r2=r2, energy_p95=energy)


def _interval(predicted: list[list[Floats]], test: list[Segment]) -> tuple[float, float]:
    """95 % interval of the MAE in W of predictions by seed and segment.

    Cluster bootstrap over source trajectories, because executions of one trajectory are alike, and over seeds.
    """
    random = np.random.default_rng(0)
    sources = sorted({segment.source for segment in test})
    place = {name: k for k, name in enumerate(sources)}
    sums, rows = np.zeros((len(predicted), len(sources))), np.zeros(len(sources))
    for k, segment in enumerate(test):
        rows[place[segment.source]] += len(segment.P)
        for seed, powers in enumerate(predicted):
            sums[seed, place[segment.source]] += np.abs(powers[k] - segment.P).sum()
    drawn = []
    for _ in range(_RESAMPLES):
        which = random.integers(len(sources), size=len(sources))
        seeds = random.integers(len(predicted), size=len(predicted))
        drawn.append(sums[seeds][:, which].sum() / (len(predicted) * rows[which].sum()))
    low, high = np.percentile(drawn, [2.5, 97.5])
    return float(low), float(high)
