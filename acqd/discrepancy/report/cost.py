"""What a cause costs: its energy per year at the duty of the recordings or another one, and EUR."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.closed import Closed
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.refit import groups_of
from acqd.discrepancy.repair.terms import FIRST_MOMENT, Reported
from acqd.models.augmented import Augmented, Term
from acqd.models.causes import added_power, parts_of
from acqd.models.effects import library
from acqd.models.effects.cause import Cause
from acqd.models.greybox.model import GreyBox
from acqd.models.yearly import Duty, Yearly, moving_rows, yearly
from acqd.report.digits import FEWEST_FOR_INTERVAL, counted, interval, number, percent
from acqd.report.verdict import KeyFigure


def cost_of(closed: Closed, each: Reported, duty: Duty) -> Yearly | None:
    """Energy per year of a named effect in the held-out recordings; None for what is no consumption of the robot.

    The interval holds the spread over recordings and the effect's size, and takes the shape as known.
    """
    subject = closed.subject
    if library()[each.term.id].cause == Cause.METER:
        return None
    powers = _restored(closed, each) if each.restored else _of_term(subject, each.term)
    if powers is None:
        return None
    segments = subject.held_out
    moving = [moving_rows(segment, subject.data.step_s) for segment in segments]
    return yearly([segment.recording for segment in segments], powers, moving, duty, size_error(each.term))


def _of_term(subject: Subject, term: Term) -> list[Floats]:
    """[T] W of an effect on every held-out segment."""
    base = subject.model.base if isinstance(subject.model, Augmented) else subject.model
    model = Augmented(base, subject.carrier, [term])
    return [added_power(model, segment) for segment in subject.held_out]


def _restored(closed: Closed, each: Reported) -> list[Floats] | None:
    """[T] W of the parameters that came back, over what the model had of them; None where they scale other terms."""
    before, after = closed.subject.model, closed.improved.base
    if not isinstance(before, GreyBox) or not isinstance(after, GreyBox):
        return None
    groups = groups_of(each)
    powers = []
    for segment in closed.subject.held_out:
        now, was = ({p.name: p.power for p in parts_of(model, segment)} for model in (after, before))
        if not groups <= set(now):
            return None
        powers.append(np.asarray(sum(now[name] - was[name] for name in groups)))
    return powers


def size_error(term: Term) -> float:
    """Relative half width of an effect's size: of several sizes the root of the sum of squares over that of sizes."""
    sizes = [p for name, p in term.parameters.items() if name not in term.shape and name != FIRST_MOMENT]
    known = [(p["value"], (p["ci95"][1] - p["ci95"][0]) / 2) for p in sizes if p["ci95"] is not None]
    whole = sum(value**2 for value, _ in known)
    return float(np.sqrt(sum(half**2 for _, half in known) / whole)) if whole else 0.0


def cost_figure(each: Reported, cost: Yearly) -> KeyFigure:
    """For the tile: kWh and EUR per year, with intervals."""
    bounds, price = cost.bounds, cost.EUR_per_kWh
    sign = "+" if cost.kWh > 0 else ""
    value, unit, scale = f"{sign}{number(cost.kWh)} kWh", "kWh", 1.0
    if price is not None:
        value, unit, scale = f"{value}, {sign}{number(cost.kWh * price)} EUR", "EUR", price
    seen = counted(cost.recordings, "recording")
    known = f"no interval from {seen}"
    if bounds is not None and cost.recordings >= FEWEST_FOR_INTERVAL:
        known = f"95 %: {interval(bounds[0] * scale, bounds[1] * scale)} {unit} ({seen})"
    return KeyFigure(f"{each.term.id}: a year", value, f"{known}; the robot moves {percent(cost.duty)} of the time")
