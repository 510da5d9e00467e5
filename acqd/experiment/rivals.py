"""What rivals explain of causes: those with the same numbers of columns and of parameters are solved for together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.gram import Indices
from acqd.discrepancy.regression.least_squares import LEAST_POWER


@dataclass(frozen=True, slots=True)
class Group:
    """Rivals with the same numbers of columns and of parameters, whose equations are solved together."""

    rivals: Indices
    columns: Indices
    """[n, k] indices into the used columns."""
    mix: Floats | None
    """[n, k, p] of columns per parameter; None: every column has a parameter of its own."""
    pull: Floats
    """[n, p, p] precision of the prior."""
    free: Floats
    """[n] log determinant of that."""
    tried: Floats
    """[n] 2 log of the places and shapes of the same kind."""

    def explained(self, schur: Floats, cross: Floats, learning_rate: float) -> tuple[Indices, Floats, Floats]:
        """Numbers of the rivals that act, [n, causes] the power that they draw of causes, and [n] what they pay.

        `schur` [used, used] of all columns, `cross` [used, causes] their products with the power of causes.
        """
        own = self.columns
        block, product = schur[own[:, :, None], own[:, None, :]], cross[own]
        if self.mix is not None:
            block, product = self.mix.mT @ block @ self.mix, self.mix.mT @ product
        acting = np.diagonal(block, axis1=1, axis2=2).min(axis=1) >= LEAST_POWER
        whole, drawn = block[acting] + self.pull[acting] / learning_rate, product[acting]
        shares = np.einsum("npc,npc->nc", drawn, np.linalg.solve(whole, drawn))
        free = np.linalg.slogdet(learning_rate * whole)[1] - self.free[acting]
        return self.rivals[acting], shares, free + self.tried[acting]


def grouped(used: Indices, rivals: Sequence[Candidate], priors: Sequence[Floats]) -> tuple[Group, ...]:
    """Groups of rivals, by `used` columns; `priors`: per rival [parameters] its prior deviations."""
    sizes = [(len(rival.indices), rival.size, rival.mix is None) for rival in rivals]
    groups = []
    for size in dict.fromkeys(sizes):
        members = [number for number, own in enumerate(sizes) if own == size]
        mix = None if size[2] else np.array([rivals[k].mix for k in members])
        groups.append(
            Group(
                np.array(members), np.searchsorted(used, [rivals[k].indices for k in members]), mix,
                np.array([np.diag(priors[k] ** -2.0) for k in members]),
                np.array([-2 * np.log(priors[k]).sum() for k in members]),
                2 * np.log([rivals[k].tried for k in members]),
            )
        )  # fmt: skip
    return tuple(groups)
