"""Testing states of IEC 61000-4-30: a quantity keeps its limit while frequency, unbalance and distortion disturb."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from acqd.conformance.signal import Mains, Signal, Three
from acqd.conformance.terminal import Terminal

BETWEEN = 0.01
"""Of Udin: interharmonic."""


@dataclass(frozen=True, slots=True)
class State:
    """What disturbs."""

    name: str
    f: float
    """Of the nominal frequency."""
    magnitudes: Three
    """Shares of Udin."""
    harmonics: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    """Order: share of Udin and angle."""
    between: float = 0.0
    """Multiple of f of an interharmonic of 1 % of Udin; 0: none."""

    def hertz(self, terminal: Terminal) -> float:
        """f."""
        return self.f * terminal.f_nominal

    def signal(self, terminal: Terminal, seconds: float) -> Signal:
        """Voltages of this state; currents of a tenth of the range."""
        U, f = terminal.declared_voltage, self.hertz(terminal)
        amperes = terminal.nominal_current
        mains = Mains(
            f,
            (U * self.magnitudes[0], U * self.magnitudes[1], U * self.magnitudes[2]),
            (amperes, amperes, amperes),
            harmonics={h: (share * U, angle) for h, (share, angle) in self.harmonics.items()},
            tones={self.between * f: BETWEEN * U} if self.between else {},
        )
        return Signal(self.text(terminal), mains, seconds)

    def text(self, terminal: Terminal) -> str:
        """In words."""
        parts = [f"state {self.name}: {self.hertz(terminal):g} Hz"]
        parts.append("U " + ", ".join(f"{100 * share:g}" for share in self.magnitudes) + " % of Udin")
        parts += [f"H{h} {100 * share:g} %" for h, (share, _) in self.harmonics.items()]
        parts += [f"interharmonic {100 * BETWEEN:g} % at {self.between:g} f"] if self.between else []
        return ", ".join(parts)


STATES = (
    State("1", 1.0, (1.0, 1.0, 1.0)),
    State("2", 0.98, (0.73, 0.80, 0.87), {3: (0.10, 0.0), 5: (0.05, 0.0), 29: (0.05, 0.0)}, 7.5),
    State("3", 1.02, (1.52, 1.40, 1.28), {7: (0.10, np.pi), 13: (0.05, 0.0), 25: (0.05, 0.0)}, 3.5),
)
