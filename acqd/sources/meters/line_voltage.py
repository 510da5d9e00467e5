"""Are the voltages of a meter those between lines? At any load, V x I is sqrt(3) times S then.

S below V x I may be distortion, whose share depends on the load. So the load must have changed while the share stayed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

_SQRT3 = math.sqrt(3)
_NEAR = 0.02
"""How near V x I / S stays to sqrt(3): classes of meters are 1 %."""
_ROUNDS, _LOADS = 30, 1.5
"""Rounds, and the largest current per smallest one in them."""
_SMALL_VA = 100.0
_LEAST_PF = 0.3


@dataclass(slots=True)
class LineVoltage:
    """Of one meter."""

    proven: bool = False
    _rounds: int = 0
    _currents: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Smallest and largest current of each phase."""

    def feed(self, values: Mapping[str, float | None]) -> bool:
        """The next round; whether it proves that voltages are those between lines, and no earlier one has."""
        shares = {k: share for k in ("L1", "L2", "L3") if (share := _share(k, values)) is not None}
        if not shares:
            return False
        if any(abs(share / _SQRT3 - 1) > _NEAR for share in shares.values()):
            self._rounds, self.proven = 0, False
            self._currents.clear()
            return False
        self._rounds += 1
        for phase in shares:
            current = abs(values[f"{phase}.Irms"] or 0.0)
            least, most = self._currents.get(phase, (current, current))
            self._currents[phase] = min(least, current), max(most, current)
        before, varied = self.proven, any(most > _LOADS * least for least, most in self._currents.values())
        self.proven = self._rounds >= _ROUNDS and varied
        return self.proven and not before


def _share(phase: str, values: Mapping[str, float | None]) -> float | None:
    """V x I per S, or per |P| / PF without S; None of a small load."""
    V, A, P, S, PF = (values.get(f"{phase}.{kind}") for kind in ("Vrms", "Irms", "P", "S", "PF"))
    if V is None or A is None or V * A < _SMALL_VA:
        return None
    if S is None and P is not None and PF is not None and abs(PF) > _LEAST_PF:
        S = P / PF
    return V * A / abs(S) if S else None
