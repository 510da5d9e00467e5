"""Every wiring that three current transformers may have, order and direction, and how likely it is."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from acqd.metering.phasors import Phasors
from acqd.metering.wiring_finding import WiringFinding

LAGS_deg = (0.0, 80.0)
"""Angles of ordinary loads: motors and drives lag (power factor 1 to 0.17)."""
_BELOW_deg, _ABOVE_deg = 12.0, 6.0
"""How fast angles outside of that become unlikely."""
_FEEDING_deg = 12.0
"""All phases within this of 180 degrees: a source that feeds back, which is no mistake."""
_REVERSED, _MOVED = 3.0, 0.9
"""Cost of a reversed transformer, and of one in the place of another: fewer mistakes are likelier."""
_ALL_REVERSED = 4.5
"""Cost of three transformers that are mounted against the flow, which is one mistake."""


class Wiring:
    """Currents in another order and direction."""

    def __init__(self, order: tuple[int, ...], sign: tuple[int, ...], found: Phasors) -> None:
        self.order, self.sign = order, sign
        currents = found.I[list(order)] * np.array(sign)
        self.lag = np.degrees(np.angle(found.U * currents.conj()))
        self.powers = (found.U * currents.conj()).real
        self.power = float(self.powers.sum())
        mean = np.exp(1j * np.radians(self.lag)).mean()
        self.common = float(np.degrees(np.angle(mean)))
        around = (self.lag - self.common + 180) % 360 - 180
        self.spread = float(np.abs(around).max())
        moved = sum(a != k for k, a in enumerate(order))
        self.against = order == (0, 1, 2) and max(sign) < 0
        mistakes = _ALL_REVERSED if self.against else sum(one < 0 for one in sign) * _REVERSED + moved * _MOVED
        low, high = LAGS_deg
        unusual = max(0.0, (low - self.common) / _BELOW_deg, (self.common - high) / _ABOVE_deg)
        self.cost = mistakes + (self.spread / 8) ** 2 + min(unusual, 20.0) ** 2
        self.changed = order != (0, 1, 2) or min(sign) < 0

    @property
    def draws(self) -> bool:
        """Whether every phase draws power."""
        return bool((np.abs(self.lag) < 90).all())

    @property
    def returns(self) -> bool:
        """Whether every phase returns nothing but active power."""
        return self.spread < _FEEDING_deg and abs(abs(self.common) - 180) < _FEEDING_deg

    def finding(self) -> WiringFinding:
        """In words, with the correction."""
        return WiringFinding(self.words(self.order, self.sign), tuple(k + 1 for k in self.order), self.sign)

    @staticmethod
    def words(order: tuple[int, ...], sign: tuple[int, ...]) -> str:
        """What is wrong, and what to change."""
        parts = []
        moved = [k for k in range(3) if order[k] != k]
        if len(moved) == 2:
            parts.append(f"the currents of L{moved[0] + 1} and L{moved[1] + 1} are exchanged")
        elif moved:
            parts.append(
                "the currents are rotated: " + ", ".join(f"i{order[k] + 1} is that of L{k + 1}" for k in range(3))
            )
        back = [f"i{order[k] + 1}" for k in range(3) if sign[k] < 0]
        if back:
            parts.append(f"{' and '.join(back)} {'is' if len(back) == 1 else 'are'} reversed")
        return " and ".join(parts)


def all_wirings(found: Phasors) -> list[Wiring]:
    """The present wiring first."""
    return [Wiring(order, sign, found) for order in permutations(range(3)) for sign in product((1, -1), repeat=3)]
