"""f of the two cycles of a window, from a fit over them and one over a longer stretch that ends with the window.

The fit over the two cycles follows every change of f; the one over the stretch has two thirds of its noise, and
belongs to some 10 ms earlier. Where the two differ by no more than they usually do, the difference is noise, and the
longer fit is the better one. Where they differ by more, f changes, and the fit over the cycles is:

    f = long + x (g + (1 - g) x^4 / (x^4 + s^4))      x = short - long

s follows the mean change of x from window to window, which noise has and a ramp of f has not. The error of a change of
f that is taken for noise is below 0.6 s, whatever f does, and s is bounded. A share g of x counts always: white noise
of the longer fit and of x are nearly independent, so that g^2 is all that noise grows by, and the lag of the longer
fit shrinks by g. The less noise, the larger g.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

from acqd.metering.packed import State

LEAST = 0.0005
"""Hz: s at least."""
MOST = 0.01
"""Hz: s at most, also of a stream that has just begun."""
SPREADS = 3.0
"""s in mean changes of x: 3.4 standard deviations of white noise."""
SHARE, CALM_SHARE = 0.15, 0.5
"""g at least, and where there is no noise."""
CALM = 0.006
"""Hz: s at which g is half of the way between them."""
FEW = 25
"""Changes of which the mean is plain; later each one counts as much as it would among so many: those of a second."""


@dataclass(slots=True)
class TwoFits:
    """Of one stream."""

    change: float = 0.0
    """Hz: mean change of x from one window to the next."""
    known: int = 0
    """Changes in this mean, as long as they are few."""
    last: float = 0.0
    """Hz: x of the last window."""
    follows: bool = False
    """Whether `last` is of the window before this one."""

    def joint(self, short: float, long: float) -> float:
        """f [Hz] of the next window."""
        x = short - long
        spread = min(max(SPREADS * self.change, LEAST), MOST) if self.known else MOST
        fourth, noise = (x * x) * (x * x), (spread * spread) * (spread * spread)
        share = SHARE + (CALM_SHARE - SHARE) / (1 + (spread / CALM) * (spread / CALM))
        return long + x * (share + (1 - share) * (fourth / (fourth + noise)))

    def note(self, short: float, long: float) -> None:
        """Remember a window whose phase was steady."""
        x = short - long
        if self.follows:
            self.known = min(self.known + 1, FEW)
            self.change += (min(abs(x - self.last), MOST) - self.change) / self.known
        self.last, self.follows = x, True

    def state(self) -> State:
        """What is known of the stream so far."""
        return asdict(self)

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""
        self.change, self.known, self.last, self.follows = (
            state[name] for name in ("change", "known", "last", "follows")
        )

    def interrupt(self) -> None:
        """The next window does not follow the last one, or that one was not steady."""
        self.follows = False
