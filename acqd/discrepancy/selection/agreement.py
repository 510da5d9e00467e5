"""Sessions that disagree about an effect: one size for all is then the mean of several causes.

A body that was mounted again another way round is a payload in both sessions, with another centre of mass. The
interaction of effect and session is one more candidate, in the same currency as all others (BIC).
"""

from __future__ import annotations

import numpy as np

from acqd.dataset.split import log_of
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.selection.accepted import Named, Tracing
from acqd.discrepancy.selection.ranking import part_of, solve_part
from acqd.discrepancy.thresholds import THRESHOLDS


def disagreeing_sessions(tracing: Tracing, named: Named) -> list[str]:
    """Logs that ask for other parameters of the effect than all logs together, the clearest first.

    Empty with a single log. The difference may be in any of the effect's places: a mass on the axis of the flange may
    be two bodies beside it. It must explain as much as an unnamed alternative would have to exceed the effect by:
    a model is wrong in another way in another motion. Judged by the power alone.
    """
    design = tracing.design
    logs: dict[str, list[int]] = {}
    for number, (part, own) in enumerate(zip(design.parts, named.gate.open, strict=True)):
        if own:
            logs.setdefault(log_of(part.recording), []).append(number)
    same = [each for each in design.columns.candidates if each.id == named.id]
    if len(logs) < 2 or not same:  # what was detected in the residual has no columns of its own
        return []
    explained = named.finding.evidence - named.finding.at_joints
    least = THRESHOLDS.alternative_margin + THRESHOLDS.alternative_share * explained + 2 * np.log(len(same))
    evidence = {log: _of_own_parameters(tracing, same, blocks) for log, blocks in logs.items()}
    return sorted((log for log, value in evidence.items() if value > least), key=lambda log: -evidence[log])


def _of_own_parameters(tracing: Tracing, candidates: list[Candidate], blocks: list[int]) -> float:
    """Largest evidence of a difference in some blocks, with the effect itself in the regression."""
    design = tracing.design
    gate = np.zeros(len(design.parts))
    gate[blocks] = 1.0
    used = np.unique(np.concatenate([candidate.places for candidate in candidates]))
    competition = tracing.regression.compete(used, gate)
    rows = np.log(max(float(design.blocks.rows @ gate), 2.0))
    largest = 0.0
    for candidate in candidates:
        own = np.searchsorted(used, candidate.places)
        schur, products = part_of(competition.schur, competition.products, own, candidate)
        if np.diag(schur).min() < THRESHOLDS.least_column_power:
            continue
        drop = float(products @ solve_part(schur, products))
        largest = max(largest, drop - candidate.size * rows)
    return largest
