"""Does the energy of a meter rise as its power says? Over hours, which no single round shows.

A register that counts Wh for kWh, one that stands still, or import and export exchanged, agrees with itself in every
round. The means of P between rounds are coarse, so only what is far off, twice in a row, is said.
"""

from __future__ import annotations

from dataclasses import dataclass

_LONGEST_S = 60.0
"""Rounds that are farther apart say nothing of the power between them."""
_STEPS, _LEAST_kWh, _STILL_kWh = 20, 0.05, 3.0
"""Energy after which both are compared: steps of the register, at least so much; of one that never rises so much."""
_ALIKE = (0.7, 1.4)
"""Energy of the register per energy of P that is no contradiction."""


@dataclass(slots=True)
class EnergyAgreement:
    """Compares W (import, kWh) of one meter with its P (W)."""

    remark: str = ""
    """What contradicts, once two comparisons in a row have said so."""
    _last: tuple[int, float, float] | None = None
    _imported: float = 0.0
    _exported: float = 0.0
    _counted: float = 0.0
    _step: float = 0.0
    _before: str = ""

    def feed(self, values: dict[str, float | None], now_ns: int) -> str:
        """The next round; what is new to say, else empty."""
        power, energy = _power(values), values.get("total.W")
        if power is None or energy is None:
            self._last = None
            return ""
        last, self._last = self._last, (now_ns, power, energy)
        if last is None or not 0 < now_ns - last[0] <= _LONGEST_S * 1e9 or energy < last[2]:
            return ""
        mean_kWh = (power + last[1]) / 2 * (now_ns - last[0]) / 3.6e15
        self._imported += max(mean_kWh, 0.0)
        self._exported += max(-mean_kWh, 0.0)
        rise = energy - last[2]
        self._counted += rise
        self._step = min(self._step or rise, rise or self._step)
        most = max(self._imported, self._exported)
        if most < (max(_LEAST_kWh, _STEPS * self._step) if self._step else _STILL_kWh):
            return ""
        said = self._compared()
        new = said if said and said == self._before and said != self.remark else ""
        self.remark = said if said == self._before else self.remark
        self._before = said
        self._imported = self._exported = self._counted = 0.0
        return new

    def _compared(self) -> str:
        if self._exported > 2 * self._imported:
            backwards = self._counted > _ALIKE[0] * self._exported
            return "its import rises while P is negative: are import and export or signs exchanged" if backwards else ""
        if self._exported > 0.1 * self._imported:
            return ""
        if not self._counted:
            return "its energy stands still while P is positive: are import and export exchanged"
        ratio = self._counted / self._imported
        if _ALIKE[0] < ratio < _ALIKE[1]:
            return ""
        return f"its energy rises {ratio:.2g} times as fast as P says: check the scales and the transformer ratios"


def _power(values: dict[str, float | None]) -> float | None:
    """P of the total [W]; of meters without one, the sum of the phases."""
    if "total.P" in values:
        return values["total.P"]
    parts = [value for name, value in values.items() if name.endswith(".P")]
    return None if not parts or None in parts else sum(one for one in parts if one is not None)
