"""Does the energy of a meter rise as its power says? Over hours, which no single round shows.

A register that counts Wh for kWh, one that stands still, or import and export exchanged, agrees with itself in every
round. P between rounds is not known (rounds may be in step with the cycles of a machine), so only what is far off for
hours, twice in a row, is said. Nothing is said where phases draw and return power at once: some registers count each
phase, others the sum.
"""

from __future__ import annotations

from dataclasses import dataclass

_LONGEST_S = 60.0
"""Rounds that are farther apart say nothing of the power between them."""
_STEPS, _LEAST_kWh, _STILL_kWh = 20, 0.05, 25.0
"""Energy after which both are compared: steps of the register, at least so much; of one that never rises so much."""
_UNITS = 2.5
"""Of the unit of the register, that a register which never rises is compared after, if that is more."""
_LEAST_S = 3 * 3600.0
"""Time after which both are compared, at least."""
_ALIKE, _RISES = (0.125, 8.0), 0.7
"""Energy of the register per energy of P that is no contradiction: a wrong scale is one of 10 or more; per exported
energy, import that is one."""


@dataclass(slots=True)
class EnergyAgreement:
    """Compares W (import, kWh) of one meter with its P (W)."""

    unit_kWh: float = 0.0
    """Unit of the register."""
    phases: int = 1
    remark: str = ""
    """What contradicts, once two comparisons in a row have said so."""
    _last: tuple[int, float, float] | None = None
    _imported: float = 0.0
    _exported: float = 0.0
    _counted: float = 0.0
    _step: float = 0.0
    _seconds: float = 0.0
    _before: str = ""

    def feed(self, values: dict[str, float | None], now_ns: int) -> str:
        """The next round; what is new to say, else empty."""
        power, energy = _power(values), values.get("total.W")
        if power is None or energy is None:
            self._last = None
            return ""
        if _opposed(values, self.phases):
            self._last = None
            self._begin()
            return ""
        last, self._last = self._last, (now_ns, power, energy)
        if last is None or not 0 < now_ns - last[0] <= _LONGEST_S * 1e9 or energy < last[2]:
            return ""
        mean_kWh = (power + last[1]) / 2 * (now_ns - last[0]) / 3.6e15
        self._imported += max(mean_kWh, 0.0)
        self._exported += max(-mean_kWh, 0.0)
        self._seconds += (now_ns - last[0]) * 1e-9
        rise = energy - last[2]
        self._counted += rise
        self._step = min(self._step or rise, rise or self._step)
        most = max(self._imported, self._exported)
        still = max(_STILL_kWh, _UNITS * self.unit_kWh)
        if self._seconds < _LEAST_S or most < (max(_LEAST_kWh, _STEPS * self._step) if self._step else still):
            return ""
        said = self._compared()
        new = said if said and said == self._before and said != self.remark else ""
        self.remark = said if said == self._before else self.remark
        self._before = said
        self._begin()
        return new

    def _begin(self) -> None:
        self._imported = self._exported = self._counted = self._seconds = 0.0

    def _compared(self) -> str:
        if self._exported > 2 * self._imported:
            backwards = self._counted > _RISES * self._exported
            return "its import rises while P is negative: are import and export or signs exchanged" if backwards else ""
        if self._exported > 0.1 * self._imported:
            return ""
        if not self._counted:
            return "its energy stands still while P is positive: are import and export exchanged"
        ratio = self._counted / self._imported
        if _ALIKE[0] < ratio < _ALIKE[1]:
            return ""
        return f"its energy rises {ratio:.2g} times as fast as P says: check the scales and the transformer ratios"


def _opposed(values: dict[str, float | None], phases: int) -> bool:
    """Whether phases draw and return power at once, or may do so because P of the phases is not read."""
    names = [f"L{k + 1}.P" for k in range(phases)]
    if phases > 1 and not values.keys() >= set(names):
        return True
    known = [P for name in names if (P := values.get(name)) is not None]
    return min(known, default=0.0) < 0 < max(known, default=0.0)


def _power(values: dict[str, float | None]) -> float | None:
    """P of the total [W]; of meters without one, the sum of the phases."""
    if "total.P" in values:
        return values["total.P"]
    parts = [value for name, value in values.items() if name.endswith(".P")]
    return None if not parts or None in parts else sum(one for one in parts if one is not None)
