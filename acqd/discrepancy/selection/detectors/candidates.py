"""Candidates whose columns are found by looking at the residual: ripple, switching loads, contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Candidate, Design, extend
from acqd.discrepancy.regression.gram import Column, Model
from acqd.discrepancy.residual.whitening import Whitener
from acqd.discrepancy.selection.detectors import ripple, switching
from acqd.models.effects import library
from acqd.models.effects.effect import effect_rows
from acqd.models.effects.places import Parameter, Place, Variant
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import averaged

_MOSTLY = 0.6  # of the time
_REGULAR = 0.33  # of a rhythm


@dataclass(frozen=True, slots=True)
class Detected:
    """A candidate and what was found."""

    candidate: Candidate
    ripple: ripple.Ripple | None = None
    by_chance: Callable[[], float] = lambda: 0.0
    """Log-likelihood that the same search wins in as many rows where there is nothing to find."""
    regular: float = 0.0


def detect(design: Design, model: Model, gate: Floats, known: set[str]) -> list[Detected]:
    """Everything that a look at the residual suggests."""
    residuals = residuals_of(design, model)
    open_ = sorted({part.segment for part, own in zip(design.parts, gate, strict=True) if own})
    found: list[Detected] = []
    if "gear_ripple" in design.chosen and "gear_ripple" not in known:
        found.append(_ripple(design, [residuals[k] for k in open_], open_))
    kinds = {"thermostat", "process_load", "contact_force"} & design.chosen - known
    flat = [np.ones(len(off)) for off in design.residual]
    searches: list[tuple[Whitener, list[Floats], tuple[int, ...]]] = []
    if kinds & {"thermostat", "process_load"}:
        searches += [(design.whitener, flat, (1,)), (design.patient, flat, (1,))]
    if "contact_force" in kinds:
        searches.append(
            (
                design.whitener,
                [
                    effect_rows(library()["contact_force"], scene, {"share_of_time": 1.0})[:, 0]
                    for scene in design.scenes
                ],
                (1, -1),
            )
        )
    for whitener, shapes, signs in searches:
        look = _Look(design, model, gate, open_, whitener, shapes, signs)
        states = look.states(residuals)
        each = None if states is None else _described(look, states, kinds, residuals)
        found += [each] if each is not None else []
    return found


@dataclass(frozen=True, slots=True)
class _Look:
    """One way to look for something that is on or off."""

    design: Design
    model: Model
    gate: Floats
    open: list[int]
    whitener: Whitener
    shapes: list[Floats]
    signs: tuple[int, ...]

    def states(self, residuals: list[Floats]) -> switching.States | None:
        """The base model has taken over part of what switches: once it is known roughly, both are fitted anew."""
        first = self.among(residuals, self.open)
        if first is None:
            return None
        columns = self.columns(first)
        places = extend(self.design, columns)
        beside = Model(self.design.blocks, [*self.model.columns, Column(int(places[0]), self.gate)])
        again = self.among(residuals_of(self.design, beside, {int(places[0])}), self.open)
        return again if again is not None and again.gain > first.gain else first

    def among(self, residuals: list[Floats], which: list[int]) -> switching.States | None:
        """Of some stretches."""
        return switching.search(
            [residuals[k] for k in which], self.whitener, [self.shapes[k] for k in which], self.signs
        )

    def columns(self, states: switching.States) -> list[Floats]:
        """[T, 1] per stretch of the design."""
        on = [np.zeros(len(off), dtype=bool) for off in self.design.residual]
        for k, found in zip(self.open, states.on, strict=True):
            on[k] = found
        return [(shape * each)[:, None] for shape, each in zip(self.shapes, on, strict=True)]

    def by_chance(self, residuals: list[Floats]) -> float:
        """Log-likelihood that the same look wins where there is nothing to find, in as many rows."""
        closed = sorted(set(range(len(self.design.residual))) - set(self.open))
        found = self.among(residuals, closed) if closed else None
        if found is None:
            return 0.0
        rows = [sum(len(residuals[k]) for k in which) for which in (self.open, closed)]
        return max(found.gain, 0.0) * rows[0] / rows[1]


def _described(look: _Look, states: switching.States, kinds: set[str], residuals: list[Floats]) -> Detected | None:
    """As a candidate, with the name that its rhythm and shape give it."""
    design = look.design
    regular = 0.0
    shape = {"share_of_time": states.share}
    if len(look.signs) > 1:
        if states.share > _MOSTLY:
            return None  # what is always there is no contact but a load
        identity, place = "contact_force", Place("flange", (0,), (Parameter("force up", "N"),))
    else:
        period, regular = switching.rhythm(states.on, [averaged(design.scenes[k].t) for k in look.open])
        identity, place = "process_load", Place("cabinet", (0,), (Parameter("power", "W", 0.0),))
        if regular > _REGULAR:
            identity, shape = "thermostat", shape | {"period_s": period}
    if identity not in kinds:
        return None
    places = extend(design, look.columns(states))
    candidate = Candidate(
        identity, place.where, places, Variant(place, (0,), shape), detected=True, cost=states.switchings
    )
    return Detected(candidate, None, partial(look.by_chance, residuals), regular)


def reference_gain(detected: Detected) -> float:
    """Evidence that the same search found in the reference, scaled to the rows; half as much again is asked for."""
    return 3 * detected.by_chance()


def residuals_of(design: Design, model: Model, omit: set[int] | None = None) -> list[Floats]:
    """[T] W per stretch: what the model leaves, not whitened; levels that wander stay in, and raw columns `omit`."""
    beta = model.solve()
    beta = np.where([c.block_intercept or c.place in (omit or ()) for c in model.columns], 0.0, beta)
    found = [off.copy() for off in design.residual]
    for number, part in enumerate(design.parts):
        weights = beta * model.gates[:, number]
        rows = part.rows
        found[part.segment][rows] = (
            design.residual[part.segment][rows] - design.raw[part.segment][rows][:, model.places] @ weights
        )
    return found


def _ripple(design: Design, residuals: list[Floats], open_: list[int]) -> Detected:
    scenes = [design.scenes[k] for k in open_]
    likeliest = ripple.scan(scenes, residuals, design.whitener)
    best = ripple.refined(likeliest[0], scenes, residuals, design.whitener)
    effect = library()["gear_ripple"]
    places = extend(design, [effect_rows(effect, scene, best.shape) for scene in design.scenes])
    parameters = (Parameter("sine", "Nm"), Parameter("cosine", "Nm"))
    place = Place(f"joint {best.joint + 1}", (0, 1), parameters)
    variant = Variant(place, (0, 1), best.shape)
    return Detected(Candidate("gear_ripple", place.where, places, variant, detected=True, cost=6.0), ripple=best)


def _contact(scene: Scene) -> Floats:
    return effect_rows(library()["contact_force"], scene, {"share_of_time": 1.0})[:, 0]
