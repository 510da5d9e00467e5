"""A load that switches in the reference, too: a compressor on the same meter is part of the site, and no change.

Its steps are larger than most effects, and no noise model of a few rows describes them. The size of the load is that of
the reference. Another load in the recordings in question remains: steps of less than half of the size are not taken
for the common load.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.loads.switching import SLOW, search, states_of
from acqd.residual.whitening import Whitener


@dataclass(frozen=True, slots=True)
class CommonLoad:
    """A load on the robot's meter that is on or off on both sides."""

    size_W: float
    whitener: Whitener
    """Of the reference without the load."""

    @classmethod
    def of(cls, residuals: list[Floats], whitener: Whitener) -> CommonLoad | None:
        """In residuals [T] W of the reference; None without a load that goes on and off again and pays the price.

        States last for seconds: what is on for a moment is what the model gets wrong in a motion. Some recording has to
        hold both edges of a state: a single one may be where an arm has stopped in another posture.
        """
        states = search(residuals, whitener, dwells=(SLOW,))
        return None if states is None or max(states.edges) < 2 else cls(states.size, whitener)

    def power(self, residuals: list[Floats]) -> list[Floats]:
        """[T] W per segment: the power of the load, where residuals [T] W show that the load is on."""
        states = states_of(residuals, self.whitener, self.size_W, SLOW)
        if states is None:
            return [np.zeros(len(each)) for each in residuals]
        return [self.size_W * share for share in states.shares]
