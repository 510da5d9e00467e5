"""What is detected in the residual: ripple, switching loads, contact, and a load that swings like a sine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.loads import switching
from acqd.discrepancy.regression.design_columns import Candidate, Twin
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Indices
from acqd.discrepancy.regression.least_squares import Column, Regression
from acqd.discrepancy.regression.scenes import Scenes
from acqd.discrepancy.selection.detectors import ripple, wave
from acqd.discrepancy.selection.detectors.rhythm import rhythm
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library
from acqd.models.effects.effect import Effect, effect_rows
from acqd.models.effects.places import Shape, Variant
from acqd.models.effects.substeps import averaged, substep_times
from acqd.models.greybox.model import GreyBox
from acqd.residual.whitening import Whitener


@dataclass(frozen=True, slots=True)
class Detection:
    """An effect with its shape and columns, as the residual suggests them; or something without a name."""

    effect: Effect | None
    """None: nothing of the library acts like this."""
    shape: Shape
    columns: list[Floats]
    """[T, k] W per unit parameter, per segment of the design."""
    cost: float = 0.0
    """Moments that were searched for: each may be any row."""
    tried: int = 1
    """Shapes that were searched."""
    refinable: bool = False
    """Whether columns follow from the shape, so that the columns of a large effect can be computed."""
    usual: float = 0.0
    """Twice the log-likelihood ratio that the same search gains in as many rows of the reference, at least 0."""
    label: str = ""
    """What acts, in words, without an effect."""
    twin: tuple[Effect, float] | None = None
    """An effect that would draw the same power, and its probability beside this one."""

    @property
    def name(self) -> str:
        """Id of the effect, or the label."""
        return self.effect.id if self.effect else self.label

    def candidate(self, indices: Indices, key: str, model: GreyBox) -> Candidate:
        """The hypothesis in the arm of `model`, once the design holds its columns at `indices`."""
        if self.effect is None:
            return Candidate(
                "", self.label, indices, detected=True, cost=self.cost, tried=self.tried, key=key,
                usual=self.usual,
            )  # fmt: skip
        place = self.effect.detected_place(self.shape, model)
        variant = Variant(place, place.columns, self.shape)
        twin = None
        if self.twin is not None:
            other, probability = self.twin
            twin = Twin(other.id, other.detected_place(self.shape, model).where, probability)
        return Candidate(
            self.effect.id, place.where, indices, variant, detected=True, cost=self.cost, tried=self.tried, key=key,
            twin=twin, usual=self.usual,
        )  # fmt: skip


def detect(design: Design, regression: Regression, gate: Floats, known: set[str]) -> list[Detection]:
    """Everything that the residual of `regression` suggests, except effects that are `known` already."""
    residuals = residuals_of(design, regression)
    segments = sorted({part.segment for part, open_ in zip(design.parts, gate, strict=True) if open_})
    wanted: dict[str, Effect] = {
        e.detected: e for e in library().values() if e.id in design.columns.chosen - known and e.detected
    }
    detections: list[Detection] = []
    if "ripple" in wanted:
        detections.append(_ripple(design, wanted["ripple"], residuals, segments))
    scenes, ones = design.columns.scenes, [np.ones(len(residual)) for residual in residuals]
    searches: list[tuple[Whitener, list[Floats], tuple[int, ...]]] = []
    if {"rhythm", "bursts"} & set(wanted):
        searches += [(design.whitener, ones, (1,)), (design.slow_whitener, ones, (1,))]
    if "contact" in wanted:
        searches.append((design.whitener, _forces(wanted["contact"], scenes), (1, -1)))
    for whitener, levels, signs in searches:
        search = _Search(design, regression, gate, segments, whitener, levels, signs)
        states = search.states(residuals)
        detection = None if states is None else _described(search, states, wanted, residuals)
        detections += [detection] if detection is not None else []
    swinging = _swinging(design, residuals, segments)
    return detections if swinging is None else [*detections, swinging]


def _forces(effect: Effect, scenes: Scenes) -> list[Floats]:
    """[T] W per segment of a contact force of 1 N that acts all the time."""
    if effect.id not in scenes.levels:
        levels = scenes.levels[effect.id] = []
        for scene in scenes:
            levels.append(effect_rows(effect, scene, {"share_of_time": 1.0})[:, 0])
            scene.moved.clear()  # torques of bodies in hours of motion are much larger than what they are needed for
    return scenes.levels[effect.id]


@dataclass(frozen=True, slots=True)
class _Search:
    """A search for something that is on or off."""

    design: Design
    regression: Regression
    gate: Floats
    segments: list[int]
    """Segments in question."""
    whitener: Whitener
    levels: list[Floats]
    """[T] per segment: power per unit while on."""
    signs: tuple[int, ...]

    def states(self, residuals: list[Floats]) -> switching.States | None:
        """States after a second search: the base model explains part of the load until the load competes with it."""
        first = self.among(residuals, self.segments)
        if first is None:
            return None
        extended, indices = self.design.with_columns(self.columns(first))
        column = Column(int(indices[0]), self.gate, owner="search")
        both = self.regression.with_columns(extended.blocks, [column])
        again = self.among(residuals_of(extended, both, omit="search"), self.segments)
        return again if again is not None and again.gain > first.gain else first

    def among(self, residuals: list[Floats], segments: list[int]) -> switching.States | None:
        """States in some segments."""
        noise = [self.design.columns.noise(k) for k in segments]
        levels = [self.levels[k] for k in segments]
        return switching.search([residuals[k] for k in segments], self.whitener, levels, self.signs, noise=noise)

    def columns(self, states: switching.States) -> list[Floats]:
        """[T, 1] per segment of the design."""
        shares = [np.zeros(len(level)) for level in self.levels]
        for k, share in zip(self.segments, states.shares, strict=True):
            shares[k] = share
        return [(level * share)[:, None] for level, share in zip(self.levels, shares, strict=True)]

    def in_reference(self, residuals: list[Floats]) -> float:
        """Twice the log-likelihood ratio that the same search gains in the reference, scaled to as many rows."""
        others = sorted(set(range(len(residuals))) - set(self.segments))
        states = self.among(residuals, others) if others else None
        if states is None:
            return 0.0
        rows = [sum(len(residuals[k]) for k in which) for which in (self.segments, others)]
        return 2 * max(states.gain, 0.0) * rows[0] / rows[1]


def _described(
    search: _Search, states: switching.States, wanted: dict[str, Effect], residuals: list[Floats]
) -> Detection | None:
    """The detection, with the effect that rhythm and level suggest; None when that effect is not wanted."""
    shape, kind, twin, regular = {"share_of_time": states.share}, "contact", None, None
    if len(search.signs) > 1:
        if 2 * states.share > 1:  # in contact for most of the time: that is a load, not a contact
            return None
    else:
        columns = search.design.columns
        step_s = columns.model.step_s
        rows = round(THRESHOLDS.walk_s / step_s)
        if switching.walks([residuals[k] for k in search.segments], states.on, rows):
            return None
        segments = [columns.segments[k] for k in search.segments]
        times = [averaged(substep_times(each.start_s, len(each.P), step_s)) for each in segments]
        regular = rhythm(states.on, times)
        kind, other = ("rhythm", "bursts") if regular.likely else ("bursts", "rhythm")
        if other in wanted:
            twin = wanted[other], min(regular.probability, 1 - regular.probability)
        if regular.likely:
            shape["period_s"] = regular.period_s
    found = partial(
        Detection, shape=shape, columns=search.columns(states), cost=float(states.switchings),
        usual=search.in_reference(residuals),
    )  # fmt: skip
    if regular is not None and regular.likely and regular.period_s < THRESHOLDS.rhythm_shortest_s:
        # no heater or fan switches so often
        return found(None, label=_pulsation(shape["period_s"]))
    return found(wanted[kind], twin=twin) if kind in wanted else None


def _swinging(design: Design, residuals: list[Floats], segments: list[int]) -> Detection | None:
    """A sine in the segments in question; its phase, as every moment that is searched for, may be any row."""
    found = wave.search([residuals[k] for k in segments], design.whitener)
    if found is None:
        return None
    columns = [np.zeros((len(residual), 1)) for residual in residuals]
    for k, column in zip(segments, found.columns([len(residuals[k]) for k in segments]), strict=True):
        columns[k] = column
    others = [each for k, each in enumerate(residuals) if k not in segments]
    before = wave.search(others, design.whitener)
    rows = [sum(map(len, which)) for which in ([residuals[k] for k in segments], others)]
    return Detection(
        None, {}, columns, cost=float(len(segments)), tried=found.tried,
        usual=0.0 if before is None else 2 * before.gain * rows[0] / rows[1],
        label=_pulsation(found.rows * design.columns.model.step_s),
    )  # fmt: skip


def _pulsation(period_s: float) -> str:
    return f"a pulsation with a period of about {period_s:.3g} s"


def residuals_of(design: Design, regression: Regression, omit: str = "") -> list[Floats]:
    """[T] W per segment: residual of the regression, not whitened.

    Random intercepts, and the columns of the effect `omit`, stay in the residual.
    """
    beta = regression.solve()
    outside = [c.block_intercept or (bool(omit) and c.owner == omit) for c in regression.columns]
    beta = np.where(outside, 0.0, beta)
    residuals = [residual.copy() for residual in design.columns.residual]
    inside: dict[int, tuple[int, int]] = {}
    for number, part in enumerate(design.parts):
        first, last = inside.get(part.segment, (part.rows.start, part.rows.stop))
        inside[part.segment] = min(first, part.rows.start), max(last, part.rows.stop)
        measured = design.columns.residual[part.segment][part.rows]
        predicted = design.power(part.segment, regression.indices, beta * regression.gates[:, number], part.rows)
        residuals[part.segment][part.rows] = measured - predicted
    for segment, (first, last) in inside.items():  # rows of unknown motion take the residual of their neighbours
        residuals[segment][:first] = residuals[segment][first]
        residuals[segment][last:] = residuals[segment][last - 1]
    return residuals


def _ripple(design: Design, effect: Effect, residuals: list[Floats], segments: list[int]) -> Detection:
    """Scanned in all segments; of long recordings, the frequency is refined in those whose scenes are kept."""
    scenes = design.columns.scenes
    every = (scenes[k] for k in segments)
    likeliest, travel = ripple.scan(design.columns.model.axes, every, [residuals[k] for k in segments], design.whitener)
    some = [k for k in segments if k in scenes.kept] or segments
    best = ripple.refined(
        effect, likeliest, travel, [scenes[k] for k in some], [residuals[k] for k in some], design.whitener
    )
    columns = [effect_rows(effect, scene, best.shape) for scene in scenes]
    return Detection(effect, best.shape, columns, tried=travel.tried, refinable=True)
