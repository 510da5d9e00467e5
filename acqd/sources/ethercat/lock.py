"""Phase control: MAIN_FAST wakes at a fixed phase of the terminal's SYNC1 (distributed clock)."""

from __future__ import annotations

_PROPORTIONAL = 0.05
_INTEGRAL = 0.002
_LIMIT = 0.02  # of the period: the most that one cycle is shifted


class PhaseLock:
    """A PI controller of the wake-up's phase against SYNC1.

    Two clocks that differ by 100 ppm slip a 1 ms cycle by 100 ns each time; the integral takes that
    over, so the phase error settles at zero.
    """

    def __init__(self, period_ns: int, target: float = 0.5) -> None:
        """`target`: the phase to hold, as a share of the period after SYNC1."""
        self._period_ns = period_ns
        self._target_ns = target * period_ns
        self._integral = 0.0

    def correction_ns(self, dc_time_ns: int, sync1_ns: int) -> int:
        """Shift of the next wake-up [ns] after an exchange at DC time `dc_time_ns`.

        SYNC1 fires at `sync1_ns` + k periods.
        """
        error = (dc_time_ns - sync1_ns - self._target_ns) % self._period_ns
        if error > self._period_ns / 2:
            error -= self._period_ns
        limit = _LIMIT * self._period_ns
        self._integral = max(-limit, min(limit, self._integral + _INTEGRAL * error))
        return -round(max(-limit, min(limit, _PROPORTIONAL * error + self._integral)))
