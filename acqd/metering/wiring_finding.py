"""One thing that is wired otherwise than it should be, and the correction of it."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WiringFinding:
    """One thing that is wired otherwise than it should be."""

    text: str
    order: tuple[int, ...] = ()
    """Currents of L1, L2, L3 by their present numbers, for a correction; empty: not a matter of currents."""
    sign: tuple[int, ...] = ()
    gain: tuple[float, ...] = ()
    """True current per measured one, of L1, L2, L3, where the ratio is wrong."""

    @property
    def gains(self) -> tuple[float, ...]:
        """Sign and ratio."""
        return tuple(sign * gain for sign, gain in zip(self.sign, self.gain or (1.0,) * len(self.sign), strict=True))

    @property
    def mistake(self) -> str:
        """The text without the measured values, which differ from minute to minute."""
        return re.sub(r"\(.*?\)| [\d.e+-]+ (times|degrees)", "", self.text)

    @property
    def correction(self) -> str:
        """What to paste below `[source]`; empty where only a screwdriver helps."""
        keys = []
        if self.order and self.order != tuple(range(1, len(self.order) + 1)):
            keys.append(f"i_order = {list(self.order)}")
        if set(self.gains) - {1.0}:
            keys.append(f"i_gain = {list(self.gains)}")
        return f"[source] correction = {{ {', '.join(keys)} }}" if keys else ""

    @property
    def remedy(self) -> str:
        """What is wrong, and what to paste."""
        return f"{self.text}; {self.correction}" if self.correction else self.text
