"""From a design to a verdict: the effect that explains most, again with it in the model, until nothing is credible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Candidate, Design
from acqd.discrepancy.regression.gram import Column, Model
from acqd.discrepancy.residual.delay import single_delay
from acqd.discrepancy.selection.detectors.candidates import Detected, detect, reference_gain
from acqd.discrepancy.selection.masking import confined, elsewhere
from acqd.discrepancy.selection.ranking import Finding, chance, rank, rank_pooled
from acqd.discrepancy.selection.shape_fit import refine
from acqd.models.effects import library
from acqd.models.effects.clocks import slope
from acqd.models.effects.places import Place

Verdict = Literal["effects_found", "nothing_left", "unknown_structure", "not_identifiable"]

LEAST_EVIDENCE = 20.0
"""White sum of squares: at tens of thousands of rows significance alone is useless."""
_DETECTED_EVIDENCE = 250.0
_UNANIMOUS_EVIDENCE = 120.0
_DETECTED_WORTH = 1.33  # times the best predictive evidence, before what was found by looking counts more
_PREDICTIVE_SHARE = 0.5
_RIVAL_MARGIN, _RIVAL_SHARE = 40.0, 0.06
_COARSE = 1.3  # times the evidence: more than a refined shape can gain
_ALPHA = 0.02
_CONSISTENT = 0.6  # of the recordings
_PLAIN_ERRORS = 2.0  # rare events: their plain gain is lost in the noise of the rows around, but must not be a loss
_LATER_SHARE = 0.03  # of the first effect's evidence: less is its shape's error
_NEIGHBOUR_SHARE = 0.12  # and of a neighbour's
_FEW = 5
_FEWEST = 3  # recordings before and after an onset
_SMALL_CLOCK_S = 0.006  # what alignments differ by
_LEAST_SHARE = 0.0025  # of the dynamic range: below, nobody at a plant would act
CLOCKS = ("clock_offset", "clock_drift")


@dataclass(frozen=True, slots=True, eq=False)
class Gate:
    """Which blocks an effect acts in."""

    label: str
    open: Floats
    """[blocks]."""
    begin: str | None = None
    """First recording, when it is not there from the start."""


@dataclass(frozen=True, slots=True)
class Named:
    """An accepted effect."""

    finding: Finding
    gate: Gate
    place: Place
    """In the effect's own columns, for the bundle."""
    shape: dict[str, float]
    detected: Detected | None
    rivals: list[Finding]
    """Best of every other effect, given what had been found before."""
    chance: float
    """Surprise that clean data exceed in 2 % of cases."""
    model: Model
    """What it competed beside."""

    @property
    def id(self) -> str:
        """Of the effect."""
        return self.finding.candidate.id


@dataclass(slots=True)
class Tracing:
    """What came of it."""

    verdict: Verdict
    found: list[Named] = field(default_factory=list)
    unknown: Finding | None = None
    unknown_gate: Gate | None = None
    model: Model | None = None
    """Base and everything found."""
    looked_at: list[Finding] = field(default_factory=list)
    """The last ranking, in which nothing was credible."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What the user asked for."""

    max_effects: int = 5
    seed: int = 1


def trace(design: Design, model: Model, gates: list[Gate], limits: Limits, progress: Callable[[str], None]) -> Tracing:
    """`gates`: the first one is the question (all of the dataset), the others are possible onsets."""
    tracing = Tracing("nothing_left", model=model)
    model = _without_small_clock(design, model, gates[0])
    while len(tracing.found) < limits.max_effects:
        progress(f"looking for effect {len(tracing.found) + 1}")
        step = _step(design, model, gates, tracing, limits)
        if step is None:
            break
        tracing.found.append(step)
        places = step.finding.candidate.places
        model = Model(design.blocks, [*model.columns, *_columns(step.finding.candidate, step.gate, places)])
    tracing.model = model
    _prune(design, tracing)
    if tracing.found:
        tracing.verdict = "effects_found"
    elif tracing.unknown is not None:
        tracing.verdict = "unknown_structure"
    return tracing


def _columns(candidate: Candidate, gate: Gate, places: np.ndarray) -> list[Column]:
    assert candidate.mix is None  # refined candidates carry their parameters' own columns
    return [Column(int(place), gate.open) for place in places]


def _without_small_clock(design: Design, model: Model, gate: Gate) -> Model:
    """Two alignments differ by a millisecond or two; that is no effect, but it must not look like one."""
    clocks = [c for c in design.candidates if c.id == "clock_offset"]
    if not clocks:
        return model
    found = rank_pooled(design, model, gate.open, clocks)
    if not found or abs(float(found[0].coefficients[0])) > _SMALL_CLOCK_S:
        return model
    return Model(design.blocks, [*model.columns, Column(int(clocks[0].places[0]), gate.open)])


def _step(design: Design, model: Model, gates: list[Gate], tracing: Tracing, limits: Limits) -> Named | None:
    """Under the likeliest onset; where nothing is credible under it, under none.

    Where nothing is, once more without the rows of effects that act at moments only.
    """
    taken = {(named.id, named.finding.candidate.label) for named in tracing.found}
    pool = [c for c in design.candidates if (c.id, c.label) not in taken or not c.id]
    found = detect(design, model, gates[0].open, {named.id for named in tracing.found})
    detected = {id(each.candidate): each for each in found}
    everywhere = _View(design, model, tracing.found, whole=True)
    likeliest = _best_gate(everywhere, gates, pool)
    step = _best_under_gate(likeliest, everywhere, gates, pool, detected, tracing, limits)
    doubt = tracing.unknown, tracing.unknown_gate
    if step is None and likeliest is not gates[0]:
        step = _best_under_gate(gates[0], everywhere, gates, pool, detected, tracing, limits)
        tracing.unknown, tracing.unknown_gate = doubt  # a second look may name, but it raises no doubts
    if step is not None:
        return _accept(design, model, gates, step, detected, tracing)
    moments = [named for named in tracing.found if confined(design, named.finding, named.gate.open)]
    if not moments:
        return None
    away = elsewhere(design, [named.finding for named in moments])
    calm = _View(away, Model(away.blocks, model.columns), [n for n in tracing.found if n not in moments], whole=False)
    step = _best_under_gate(_best_gate(calm, gates, pool), calm, gates, pool, {}, tracing, limits)
    tracing.unknown, tracing.unknown_gate = doubt
    return None if step is None else _accept(design, model, gates, step, {}, tracing)


@dataclass(frozen=True, slots=True)
class _View:
    """Rows that are looked at, and effects whose shape may be wrong in them."""

    design: Design
    model: Model
    prior_findings: list[Named]
    whole: bool
    """All of the design's rows, so that columns can be added."""


@dataclass(frozen=True, slots=True)
class _Winner:
    """What won under a gate."""

    finding: Finding
    gate: Gate
    rivals: list[Finding]
    limit: float


def _accept(
    design: Design, model: Model, gates: list[Gate], best: _Winner, detected: dict[int, Detected], tracing: Tracing
) -> Named:
    """With columns of its own, over all rows."""
    tracing.unknown = tracing.unknown_gate = None
    candidate = best.finding.candidate
    gate = gates[0] if candidate.detected else best.gate
    own = detected.get(id(candidate))
    finding, shape = refine(design, model, gate.open, best.finding, own)
    assert candidate.variant is not None
    return Named(finding, gate, candidate.variant.place, shape, own, best.rivals, best.limit, model)


def _best_under_gate(
    gate: Gate,
    view: _View,
    gates: list[Gate],
    pool: list[Candidate],
    detected: dict[int, Detected],
    tracing: Tracing,
    limits: Limits,
) -> _Winner | None:
    design, model = view.design, view.model
    findings = rank(design, model, gate.open, pool)
    if detected:
        findings += rank(design, model, gates[0].open, [each.candidate for each in detected.values()])
    findings.sort(key=lambda finding: -_worth(finding))
    tracing.looked_at = findings
    named = [finding for finding in findings if finding.candidate.id]
    unnamed = [finding for finding in findings if not finding.candidate.id]
    limit = float(np.quantile(chance(model, gate.open, pool, limits.seed), 1 - _ALPHA))
    if gate is not gates[0]:
        limit += np.log(len(gates))  # it was the best of so many
    best = next((finding for finding in named if _credible(view, finding, limit, detected)), None)
    rival = next((finding for finding in unnamed if _credible(view, finding, limit, detected)), None)
    if rival is not None and (best is None or (_outdone(best, rival) and not _defended(view, gate, best, rival))):
        if tracing.unknown is None:
            tracing.unknown, tracing.unknown_gate = rival, gate
        return None
    if best is None:
        return None
    return _Winner(best, gate, _one_each([each for each in named if _serious(design, each)], best), limit)


def _worth(finding: Finding) -> float:
    """What counts in the ranking: explained beyond chance, here and on recordings that took no part."""
    return min(finding.evidence, finding.held_out) / (_DETECTED_WORTH if finding.candidate.detected else 1.0)


def _outdone(best: Finding, rival: Finding) -> bool:
    if best.candidate.detected:  # found by looking: anything that foresees half as much is the better explanation
        return rival.evidence > _PREDICTIVE_SHARE * best.evidence
    return rival.evidence > best.evidence + _RIVAL_MARGIN + _RIVAL_SHARE * best.evidence


def _defended(view: _View, gate: Gate, best: Finding, rival: Finding) -> bool:
    """Whether an effect is not outdone once its shape is refined.

    Scanned shapes are coarse, and their columns are those of a small effect.
    """
    if not view.whole or best.candidate.detected or rival.evidence > _COARSE * best.evidence:
        return False
    refined, _ = refine(view.design, view.model, gate.open, best, None)
    return not _outdone(replace(best, evidence=refined.evidence), rival)


def _credible(view: _View, finding: Finding, limit: float, detected: dict[int, Detected]) -> bool:
    least = LEAST_EVIDENCE
    if finding.candidate.detected and finding.evidence > _DETECTED_EVIDENCE:
        least = max(_DETECTED_EVIDENCE, reference_gain(detected[id(finding.candidate)]))
    elif finding.candidate.detected:
        return False
    for earlier in view.prior_findings:
        neighbour = finding.candidate.id in library()[earlier.id].neighbours or finding.candidate.id in ("", earlier.id)
        least = max(least, (_NEIGHBOUR_SHARE if neighbour else _LATER_SHARE) * earlier.finding.evidence)
    return (
        finding.evidence > least
        and relevant(view.design, finding)
        and (finding.surprise > limit or _unanimous(finding))
        and finding.held_out > 0
        and finding.plain > -_PLAIN_ERRORS * finding.plain_error
        and finding.consistency >= _CONSISTENT
    )


def _serious(design: Design, finding: Finding) -> bool:
    """Whether it is a rival at all."""
    return finding.held_out > 0 and finding.plain > 0 and relevant(design, finding)


def relevant(design: Design, finding: Finding) -> bool:
    """Whether it is more than a trace of power while it acts; differences of two alignments are none."""
    candidate, theta = finding.candidate, finding.coefficients
    weights = theta if candidate.mix is None else candidate.mix @ theta
    power = np.concatenate([raw[:, candidate.places] @ weights for raw in design.raw])
    size = np.abs(power)
    acting = power[size > 0.05 * size.max()]
    if candidate.id in CLOCKS:
        seconds = size.max() / max(float(np.abs(np.concatenate([slope(s) for s in design.scenes])).max()), 1e-9)
        return seconds > _SMALL_CLOCK_S and _seen_directly(design, float(theta[0]))
    return bool(np.sqrt(np.mean(acting**2)) > _LEAST_SHARE * design.dynamic_range)


def _seen_directly(design: Design, seconds: float) -> bool:
    """Whether shifting whole recordings says so too: a slope also stands for motion that is sharper than logged."""
    in_question = sorted({part.segment for part in design.parts if part.in_question})
    delays = [single_delay(design.scenes[k], design.segments[k].P) for k in in_question]
    reported_only = [delay for delay in delays if delay is not None]
    return bool(reported_only) and abs(float(np.median(reported_only)) - seconds) < 0.5 * abs(seconds)


def _unanimous(finding: Finding) -> bool:
    """Nearly every recording where it acts says so: a few loud ones, or few at all, cannot surprise otherwise."""
    if finding.acting >= _FEW:
        return finding.consistency >= 0.9 and finding.evidence > _UNANIMOUS_EVIDENCE
    loud = finding.evidence > 4 * _DETECTED_EVIDENCE and finding.held_out > 0.5 * finding.evidence
    return finding.acting >= _FEWEST and finding.consistency == 1.0 and loud


def _one_each(named: list[Finding], best: Finding) -> list[Finding]:
    seen, rivals = {best.candidate.id}, []
    for finding in named:
        if finding.candidate.id not in seen:
            seen.add(finding.candidate.id)
            rivals.append(finding)
    return rivals


def _best_gate(view: _View, gates: list[Gate], pool: list[Candidate]) -> Gate:
    """All of it, unless an onset explains clearly more."""
    best = [rank_pooled(view.design, view.model, gate.open, pool)[:1] for gate in gates]
    evidence = np.array([found[0].evidence if found else -np.inf for found in best])
    top = int(evidence.argmax())
    return gates[top] if evidence[top] > 1.05 * evidence[0] + 40.0 else gates[0]


def _prune(design: Design, tracing: Tracing) -> None:
    """Effects that the later ones made superfluous go."""
    assert tracing.model is not None
    for named in list(tracing.found):
        if len(tracing.found) < 2:
            return
        own = set(named.finding.candidate.places.tolist())
        others = [c for c in tracing.model.columns if not (c.place in own and c.gate is named.gate.open)]
        without = Model(design.blocks, others)
        again = rank_pooled(design, without, named.gate.open, [named.finding.candidate])
        if not again or again[0].evidence < LEAST_EVIDENCE:
            tracing.found.remove(named)
            tracing.model = without


def onset_gates(design: Design, in_question: Floats) -> list[Gate]:
    """All of the dataset, and from each of its recordings on (in the order of time)."""
    times: dict[str, float] = {}
    for part, own in zip(design.parts, in_question, strict=True):
        if own:
            times[part.recording] = min(times.get(part.recording, np.inf), part.start_s)
    order = sorted(times, key=lambda name: times[name])
    gates = [Gate("all of it", in_question)]
    for number in range(_FEWEST, len(order) - _FEWEST + 1):
        later = set(order[number:])
        gate = np.array([float(part.recording in later) for part in design.parts]) * in_question
        gates.append(Gate(f"from {order[number]} on", gate, order[number]))
    return gates
