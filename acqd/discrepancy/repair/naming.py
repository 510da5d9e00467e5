"""Which selected effects get a name: sure enough, and with a size (ADR 26)."""

from __future__ import annotations

from collections.abc import Callable

from acqd.discrepancy.delay import Delay
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.terms import Reported, clock_term, reported
from acqd.discrepancy.repair.torque_scale import torque_scale
from acqd.discrepancy.selection.accepted import Selected, Selection, unnamed
from acqd.discrepancy.selection.beyond_reference import only_beyond_reference
from acqd.discrepancy.selection.placing import without
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.report.digits import percent


def named_effects(
    subject: Subject, selection: Selection, delay: Delay | None, progress: Callable[[str, float], None]
) -> list[Reported]:
    """The clock term of `delay` and the selected effects, each named or a hypothesis with the reason."""
    effects: list[Reported] = [clock_term(delay)] if delay is not None else []
    scale = torque_scale(subject)
    judged = {}
    for selected in selection.effects:
        progress(f"confidence of {selected.id}", 0.0)
        judged[selected.key] = named_or_not(reported(selection, selected, scale))
    selection.design.columns.scenes.drop_kept()
    progress("the same at speeds of the reference", 0.0)
    for selected in selection.effects:
        if judged[selected.key].status == "named" and _only_beyond_reference(selection, selected):
            lacks = "evidence at speeds that the reference has, too"
            judged[selected.key] = judged[selected.key].without_name("refused", lacks)
    return [*effects, *judged.values()]


def _only_beyond_reference(selection: Selection, selected: Selected) -> bool:
    """Whether an effect passes only in motion that is faster than any in the reference (ADR 54)."""
    rows = without(selection.rows, selected)
    return only_beyond_reference(rows, selected.gate.open, selected.finding, selected.hypothesis.margin)


def named_or_not(effect: Reported) -> Reported:
    """The effect as it is; a hypothesis, where another cause is too likely; refused, where there may be no cause."""
    if not effect.possible:
        return effect.without_name("refused", "a size within its physical bounds")
    if effect.may_be_nothing:
        return effect.without_name("refused", "a size whose 95 % interval excludes zero")
    least = THRESHOLDS.least_confidence
    if effect.doubt is not None:
        law = unnamed(effect.doubt.finding.candidate.label)
        return effect.without_name("hypothesis", f"more evidence than {law}")
    if effect.hypothesis is not None and effect.family_confidence < least:
        return effect.without_name(
            "hypothesis", f"a confidence of {percent(least)} (the effect has {percent(effect.family_confidence)})"
        )
    rival, share = max(effect.alternatives, key=lambda pair: pair[1], default=("", 0.0))
    if effect.hypothesis is not None and share > effect.confidence:  # beside later effects, another one leads
        return effect.without_name("hypothesis", f"more evidence than {rival}")
    return effect
