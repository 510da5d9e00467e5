"""The columns of all recordings in W, and which hypothesis owns which of them."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.discrepancy.loads.common import CommonLoad
from acqd.discrepancy.regression.gram import Indices
from acqd.discrepancy.regression.grey_box_columns import grey_box_columns
from acqd.discrepancy.regression.scenes import Scenes
from acqd.discrepancy.regression.smooth_alternatives import Ranges, Survey, alternatives, smooth_columns
from acqd.discrepancy.regression.torque_alternatives import LawColumns
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library
from acqd.models.effects.effect import Effect, effect_rows
from acqd.models.effects.laws.law import MotionRange
from acqd.models.effects.places import Variant
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import Lag
from acqd.models.greybox.model import GreyBox
from acqd.models.segments import Segment
from acqd.residual.known_rows import known_rows
from acqd.residual.thresholds import NOISE

_AT_ONCE = 16
"""Columns at substeps that are filtered together: a call for each costs more than the filter, all take memory."""


@dataclass(frozen=True, slots=True)
class Twin:
    """Another effect that would draw the same power at the same times."""

    id: str
    where: str
    probability: float
    """That the other effect is there, if one of the two is."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A hypothesis: an effect in one shape at one place, or an unnamed smooth alternative.

    Compared by `key`, never as a whole.
    """

    id: str
    """Of the effect; "" for an unnamed alternative."""
    label: str
    """Place of the effect, or the quantity that an alternative depends on."""
    indices: Indices
    """Indices of columns."""
    variant: Variant | None = None
    detected: bool = False
    """Whether the columns were detected in the residual."""
    cost: float = 0.0
    """Moments in the residual that were searched for: each pays the logarithm of the rows."""
    usual: float = 0.0
    """Evidence that the same search gains in the reference, before the learning rate: what the model gets wrong."""
    tried: int = 1
    """Places and shapes of the same kind that compete: the best of them pays for the choice."""
    key: str = ""
    """Identity within a design; equal keys are the same hypothesis."""
    fitted: Variant | None = None
    """With a fitted shape, and columns as in `Effect.at`; None: a scanned shape."""
    law_columns: LawColumns | None = None
    """Of an unnamed alternative that can correct a model."""
    twin: Twin | None = None

    @property
    def kind(self) -> str:
        """Id of the effect or of the law, or the quantity that an alternative depends on."""
        return self.id or (self.law_columns.law.id if self.law_columns else self.label)

    @property
    def size(self) -> int:
        """Number of free coefficients."""
        return self.variant.size if self.variant else len(self.indices)

    @property
    def mix(self) -> Floats | None:
        """[columns, coefficients]."""
        return self.variant.place.mix if self.variant else None

    def weights(self, coefficients: Floats) -> Floats:
        """[columns] weights of the columns for coefficients of the parameters."""
        return coefficients if self.mix is None else np.asarray(self.mix @ coefficients)


@dataclass(frozen=True, slots=True)
class Part:
    """A block of rows."""

    recording: str
    in_question: bool
    """Of the dataset in question; else of the reference."""
    start_s: float
    segment: int
    rows: slice
    """Within the segment: the block's own rows, and before them the rows of its past."""
    past: int
    """Number of rows before the block's own: the noise order, or 0 for the first block of a segment."""
    noise: Floats | float = field(default=1.0, compare=False)
    """[own rows] standard deviation of the noise relative to that of the noise model."""

    @property
    def own(self) -> slice:
        """The block's own rows, within the segment."""
        return slice(self.rows.start + self.past, self.rows.stop)


@dataclass(frozen=True, slots=True)
class DesignColumns:
    """Columns and residuals before whitening."""

    model: GreyBox
    base: int
    """Number of columns of the base model; they come first."""
    candidates: tuple[Candidate, ...]
    parts: tuple[Part, ...]
    segments: tuple[Segment, ...]
    scenes: Scenes
    values: tuple[NDArray[np.float32], ...]
    """[T, p] per segment."""
    residual: tuple[Floats, ...]
    """[T] W per segment: measured minus predicted by the base model and the common load."""
    chosen: frozenset[str]
    """Ids of effects that compete."""
    motion: MotionRange
    """That all recordings cover."""
    dynamic_range: float
    """p99 - p1 of the measured power, W."""
    named: Callable[[Scene], NDArray[np.float32]]
    """[T, base and effects] W: the first columns, those of the base model and of all effects, in another scene."""
    load: CommonLoad | None = None
    """That switches on both sides."""
    rising: float = 0.0
    """Of the noise's variance with the square of the power that is new in a row (`row_noise`)."""

    def noise(self, segment: int) -> Floats:
        """[T] standard deviation of a segment's white rows, relative to that of the noise model."""
        deviation = np.ones(len(self.residual[segment]))
        for part in self.parts:
            if part.segment == segment:
                deviation[part.own] = part.noise
        return deviation

    @property
    def in_question(self) -> Floats:
        """[blocks] 1 for the dataset in question."""
        return np.array([part.in_question for part in self.parts]) * 1.0

    def with_withheld(self, groups: Iterable[str]) -> DesignColumns:
        """Residuals of the base model without some groups of its parameters: what they explain is to be found."""
        layout = self.model.layout
        residual = list(self.residual)
        for group in groups:
            place = layout.part(group)
            for number, values in enumerate(self.values):
                residual[number] = residual[number] + values[:, place] @ self.model.values[place]
        return replace(self, residual=tuple(residual))


def design_columns(
    model: GreyBox,
    segments: list[tuple[Segment, bool]],
    chosen: frozenset[str],
    withheld: frozenset[str],
    progress: Callable[[float], None],
    begins: Mapping[str, float] | None = None,
) -> DesignColumns:
    """Columns of the base model, of the chosen effects and of all alternatives.

    `segments`: with whether they are in question; `withheld`: groups of parameters that the model was denied;
    `begins`: UTC of the start of the sessions in question, where their first recordings are held out.
    """
    scenes = Scenes(model, segments)
    ranges, effects = _surveyed(scenes, [effect for name, effect in library().items() if name in chosen])
    _remember_common(scenes, effects, begins or {})
    named = partial(_named_rows, effects=effects, withheld=withheld)
    values: list[NDArray[np.float32]] = []
    residual: list[Floats] = []
    for number, (scene, side) in enumerate(zip(scenes, scenes.in_question, strict=True)):
        values.append(_rows(scene, named(scene), smooth_columns(scene, ranges, in_question=side)))
        residual.append(scenes.segments[number].P - scene.predicted)
        scene.moved.clear()  # torques of bodies in hours of motion are much larger than what they are needed for
        scene.computed.clear()
        progress((number + 1) / len(scenes))
    return DesignColumns(
        model=model, base=model.layout.size,
        candidates=tuple(_candidates(model, effects, scenes[0], difference=not all(scenes.in_question))),
        parts=tuple(_parts(segments, model.step_s)), segments=scenes.segments, scenes=scenes, values=tuple(values),
        residual=tuple(residual), chosen=chosen, motion=ranges.motion, named=named,
        dynamic_range=float(np.ptp(np.percentile(np.concatenate([s.P for s in scenes.segments]), [1, 99]))),
    )  # fmt: skip


def _named_rows(scene: Scene, *, effects: list[Effect], withheld: frozenset[str]) -> NDArray[np.float32]:
    """[T, k] W: columns of the base model and of effects."""
    columns = [grey_box_columns(scene, withheld), *(effect_rows(effect, scene) for effect in effects)]
    return np.concatenate(columns, axis=1, dtype=np.float32, casting="same_kind")


def _rows(scene: Scene, named: NDArray[np.float32], unnamed: list[Floats]) -> NDArray[np.float32]:
    """[T, p] from columns [T, k] of rows, and from single columns [N] at substeps before the supply's lag."""
    first = named.shape[1]
    rows = np.empty((scene.rows, first + len(unnamed)), dtype=np.float32)
    rows[:, :first] = named
    lag_s = float(scene.model.group("lag")[0])
    for place in range(0, len(unnamed), _AT_ONCE):
        some = np.column_stack(unnamed[place : place + _AT_ONCE])
        rows[:, first + place : first + place + _AT_ONCE] = Lag(lag_s, scene.step_s).means(some)
    return rows


def _candidates(model: GreyBox, effects: list[Effect], scene: Scene, *, difference: bool) -> list[Candidate]:
    """`difference`: from a reference, which may have some of the effects already."""
    candidates: list[Candidate] = []
    place = model.layout.size
    for effect in effects:
        for number, variant in enumerate(effect.variants(scene)):
            where = variant.place.where
            indices = place + np.array(variant.columns)
            asked = variant if difference else variant.without_reference()
            candidates.append(Candidate(effect.id, where, indices, asked, key=f"{effect.id} {number}"))
        place += effect_rows(effect, scene).shape[1]
    candidates += [
        Candidate("", each.name, place + np.array(each.columns), key=each.name, law_columns=each.law_columns)
        for each in alternatives(model.axes)
    ]
    tried = Counter(candidate.kind for candidate in candidates)
    return [replace(candidate, tried=tried[candidate.kind]) for candidate in candidates]


def _surveyed(scenes: Scenes, effects: list[Effect]) -> tuple[Ranges, list[Effect]]:
    """What the scenes cover, and the effects that are possible in all of them."""
    surveys: list[Survey] = []
    for scene in scenes:
        surveys.append(Survey.of(scene))
        effects = [effect for effect in effects if effect.possible(scene)]
    return Ranges.of(surveys, scenes.in_question), effects


def _remember_common(scenes: Scenes, effects: list[Effect], begins: Mapping[str, float]) -> None:
    """What is the same in all scenes: fixed shapes, and the start of the session for effects of the clock."""
    sessions = [(side, segment.session) for side, segment in zip(scenes.in_question, scenes.segments, strict=True)]
    origins = {(True, name): start_s for name, start_s in begins.items()}
    for session, segment in zip(sessions, scenes.segments, strict=True):
        origins[session] = min(segment.start_s, origins.get(session, np.inf))
    for k, session in enumerate(sessions):
        scenes.remember(k, {"origin_s": origins[session], "worked_s": scenes.segments[k].worked_s})
    for effect in effects:
        fixed = effect.fixed_shape(scenes)
        for k in range(len(scenes)):
            scenes.remember(k, fixed)


def _parts(segments: list[tuple[Segment, bool]], step_s: float) -> list[Part]:
    parts = []
    for number, (segment, in_question) in enumerate(segments):
        known = known_rows(segment)
        inside = (known.start, known.stop)
        count = max(1, round((inside[1] - inside[0]) / NOISE.block_rows))
        edges = np.linspace(*inside, count + 1).astype(int).tolist()
        for first, last in itertools.pairwise(edges):
            if last - first >= THRESHOLDS.block_least_rows:
                past = NOISE.noise_order if first > inside[0] else 0
                start_s = segment.start_s + (first - past) * step_s
                parts.append(Part(segment.recording, in_question, start_s, number, slice(first - past, last), past))
    return parts
