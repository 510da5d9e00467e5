"""Where the model itself lacks something, its other parameters have taken over part of it: all are fitted anew."""

from __future__ import annotations

import numpy as np

from acqd.discrepancy.augment import Added
from acqd.discrepancy.design import Design
from acqd.discrepancy.subject import Subject
from acqd.discrepancy.trace import Tracing
from acqd.models.greybox.fit import fit_grey_box
from acqd.models.greybox.model import GreyBox
from acqd.models.predictor import Predictor

NATIVE = {
    "copper_loss": "copper",
    "coulomb_friction": "coulomb",
    "viscous_friction": "viscous",
    "mechanical_power": "gain",
}
"""Effects that are groups of a grey box' own parameters."""


def refitted(subject: Subject, design: Design, tracing: Tracing, found: list[Added]) -> tuple[Predictor, list[Added]]:
    """A grey box beside its effects; other models stay as they are.

    An effect that a grey box has a group of parameters for, and was denied, comes back as that group.
    """
    if not isinstance(subject.model, GreyBox) or tracing.model is None:
        return subject.model, found
    restored = {NATIVE[each.term.id] for each in found if NATIVE.get(each.term.id) in subject.withheld}
    if restored:
        rest = tuple(sorted(subject.withheld - restored))
        fit = fit_grey_box(subject.robot, subject.fit, subject.data.step_s, 1, lambda _: None, rest)
        return fit.model, [each for each in found if NATIVE.get(each.term.id) not in restored]
    beta, _ = tracing.model.solve()
    values = subject.carrier.values + beta[: design.base]
    low = subject.carrier.layout.lowest()
    for group in subject.withheld:
        values[subject.carrier.layout.place(group)] = 0.0
    carrier = subject.carrier
    return (
        GreyBox(carrier.chain, carrier.layout, np.maximum(values, low), carrier.step_s, carrier.usual_signals()),
        found,
    )
