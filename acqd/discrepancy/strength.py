"""How strong an effect is in every block: what the report shows of rows that are not kept for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.selection.accepted import Selected, Selection


@dataclass(frozen=True, slots=True, eq=False)
class Strength:
    """Of a selected effect beside all others."""

    power: Floats
    """[rows] W of the effect as fitted."""
    left: Floats
    """[rows] W: residual without the effect."""
    shares: Floats
    """[blocks in which the effect acts] strength relative to the fit, in the order of time."""

    @classmethod
    def of(cls, selection: Selection, selected: Selected) -> Strength:
        """In the blocks under the effect's gate."""
        design, regression = selection.design, selection.regression
        beta = regression.solve()
        mine = np.array([column.owner == selected.key for column in regression.columns])
        power, left, shares = [], [], []
        for number, part in enumerate(design.parts):
            if not selected.gate.open[number]:
                continue
            values = design.values(part.segment, regression.indices, part.rows)
            weights = beta * regression.gates[:, number]
            effect = values @ np.where(mine, weights, 0.0)
            rest = design.columns.residual[part.segment][part.rows] - values @ np.where(mine, 0.0, weights)
            power.append(effect)
            left.append(rest)
            square = float(effect @ effect)
            if square > 0:
                shares.append((part.start_s, float(effect @ rest) / square))
        return cls(np.concatenate(power), np.concatenate(left), np.array([share for _, share in sorted(shares)]))
