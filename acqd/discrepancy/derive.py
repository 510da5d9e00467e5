"""Candidates whose columns are found by looking at the residual: ripple, switching loads, contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.discrepancy import ripple, switching
from acqd.discrepancy.design import Candidate, Design, extend
from acqd.discrepancy.effect import Parameter, Place, Variant
from acqd.discrepancy.effects.load import point_mass, power_of, torque_of
from acqd.discrepancy.evidence import Model
from acqd.discrepancy.scene import Lag, Scene, averaged
from acqd.robot.description import Floats

_GRAVITY = 9.81
_REGULAR = 0.45  # of a rhythm


@dataclass(frozen=True, slots=True)
class Derived:
    """A candidate and what was found."""

    candidate: Candidate
    ripple: ripple.Ripple | None = None
    states: list[NDArray[np.bool_]] | None = None
    """[T] per stretch of the design, False where the gate is closed."""
    reference_gain_per_row: float = 0.0
    """The same search on reference recordings, where there is nothing to find."""
    rows: int = 0
    """That were searched."""
    regular: float = 0.0


def derive(design: Design, model: Model, gate: Floats, known: set[str]) -> list[Derived]:
    """Everything that a look at the residual suggests."""
    residuals = residuals_of(design, model)
    open_ = sorted({part.stretch for part, own in zip(design.parts, gate, strict=True) if own})
    closed = sorted({part.stretch for part in design.parts} - set(open_))
    found = []
    if "gear_ripple" in design.chosen and "gear_ripple" not in known:
        found.append(_ripple(design, [residuals[k] for k in open_], open_))
    kinds = {"thermostat", "process_load", "contact_force"} & design.chosen - known
    if kinds & {"thermostat", "process_load"}:
        each = _switching(design, residuals, open_, closed, kinds)
        found += [each] if each else []
    if "contact_force" in kinds:
        each = _contact(design, residuals, open_, closed)
        found += [each] if each else []
    return found


def reference_gain(design: Design, derived: Derived) -> float:
    """Evidence that the same search found in the reference, scaled to the rows; half as much again is asked for."""
    return 3 * derived.reference_gain_per_row * derived.rows


def residuals_of(design: Design, model: Model) -> list[Floats]:
    """[T] W per stretch: what the model leaves, not whitened."""
    beta, _ = model.solve()
    found = [off.copy() for off in design.off]
    for part in design.parts:
        number = design.parts.index(part)
        weights = beta * model.gates[:, number]
        rows = part.rows
        found[part.stretch][rows] = design.off[part.stretch][rows] - design.raw[part.stretch][rows][:, model.places] @ weights
    return found


def _ripple(design: Design, residuals: list[Floats], open_: list[int]) -> Derived:
    scenes = [design.scenes[k] for k in open_]
    likeliest = ripple.scan(scenes, residuals, design.whitener)
    best = ripple.refined(likeliest[0], scenes, residuals, design.whitener)
    places = extend(design, [_ripple_rows(best, scene) for scene in design.scenes])
    parameters = (Parameter("sine", "Nm"), Parameter("cosine", "Nm"))
    place = Place(f"joint {best.joint + 1}", (0, 1), parameters)
    variant = Variant(place, (0, 1), {"periods_per_turn": best.periods})
    return Derived(Candidate("gear_ripple", place.where, places, variant, derived=True, cost=6.0), ripple=best)


def _ripple_rows(found: ripple.Ripple, scene: Scene) -> Floats:
    return averaged(Lag(float(scene.model.group("lag")[0]), scene.step_s).run(found.columns(scene)))


def _switching(
    design: Design, residuals: list[Floats], open_: list[int], closed: list[int], kinds: set[str]
) -> Derived | None:
    states = switching.search([residuals[k] for k in open_], design.whitener)
    if states is None:
        return None
    on = _placed(design, states.on, open_)
    times = [averaged(design.scenes[k].t) for k in open_]
    period, regular = switching.rhythm(states.on, times)
    identity = "thermostat" if regular > _REGULAR else "process_load"
    if identity not in kinds:
        return None
    shape = {"period_s": period, "duty": states.share} if identity == "thermostat" else {"share_of_time": states.share}
    place = Place("cabinet", (0,), (Parameter("power", "W", 0.0),))
    places = extend(design, [each[:, None] * 1.0 for each in on])
    candidate = Candidate(identity, "cabinet", places, Variant(place, (0,), shape), derived=True, cost=states.switchings)
    return Derived(
        candidate,
        None,
        on,
        _reference(design, residuals, closed, None),
        _rows(residuals, open_),
        regular,
    )


def _contact(design: Design, residuals: list[Floats], open_: list[int], closed: list[int]) -> Derived | None:
    shapes = [contact_rows(scene) for scene in design.scenes]
    states = switching.search([residuals[k] for k in open_], design.whitener, [shapes[k] for k in open_], (1, -1))
    if states is None:
        return None
    on = _placed(design, states.on, open_)
    place = Place("flange", (0,), (Parameter("force up", "N"),))
    places = extend(design, [(shape * each)[:, None] for shape, each in zip(shapes, on, strict=True)])
    candidate = Candidate(
        "contact_force", "flange", places, Variant(place, (0,), {"share_of_time": states.share}), derived=True,
        cost=states.switchings,
    )  # fmt: skip
    return Derived(candidate, None, on, _reference(design, residuals, closed, shapes), _rows(residuals, open_))


def contact_rows(scene: Scene) -> Floats:
    """[T] W per N up on the flange: what holds a weight there, the other way round."""
    body = point_mass(scene.model.chain.beyond_flange(0.0)) / _GRAVITY
    power = -power_of(scene, torque_of(scene, scene.axes - 1, body, static=True))
    return averaged(Lag(float(scene.model.group("lag")[0]), scene.step_s).run(power[:, None]))[:, 0]


def _placed(design: Design, on: list[NDArray[np.bool_]], open_: list[int]) -> list[NDArray[np.bool_]]:
    found = [np.zeros(len(off), dtype=bool) for off in design.off]
    for k, states in zip(open_, on, strict=True):
        found[k] = states
    return found


def _rows(residuals: list[Floats], which: list[int]) -> int:
    return sum(len(residuals[k]) for k in which)


def _reference(design: Design, residuals: list[Floats], closed: list[int], shapes: list[Floats] | None) -> float:
    if not closed:
        return 0.0
    found = switching.search(
        [residuals[k] for k in closed],
        design.whitener,
        None if shapes is None else [shapes[k] for k in closed],
        (1,) if shapes is None else (1, -1),
    )
    return max(found.gain, 0.0) / _rows(residuals, closed) if found else 0.0
