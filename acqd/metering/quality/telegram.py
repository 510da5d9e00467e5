"""Recording of mains signalling (IEC 61000-4-30, 5.10): from the value on that exceeds a threshold, for a set time.

A telegram is a sequence of pulses of the carrier, so its level and its bits are the 10/12-cycle values while it lasts;
a recording does not end when the carrier pauses.
"""

from __future__ import annotations

from dataclasses import replace

from acqd.metering.quality.values import QualityValues

SIGNALLING = "signalling"
"""Flag of the values that are recorded."""
_DISTURBED = frozenset({"dip", "swell", "interruption", "gap"})
"""A step of the voltage has lines at the carrier, too: no recording begins with it."""
_BRIEF = "transient"
"""A phase jump has them in one value; a carrier that beats with the fundamental (175 Hz) has them in all."""
_RECORDED = ("Vrms", "V_ms")


class TelegramRecorder:
    """Of one stream."""

    def __init__(self, threshold: float, seconds: float) -> None:
        """`threshold` [V] of the signal voltage in any phase; a recording lasts `seconds`."""
        self._threshold, self._seconds = threshold, seconds
        self._left = 0.0
        self._follows = False
        """Whether the value before exceeded the threshold without a step of the voltage."""

    def noted(self, values: QualityValues) -> QualityValues:
        """The next value of 10/12 cycles, flagged where it belongs to a recording."""
        due = self._left > values.duration / 2
        exceeds = not values.flags & _DISTURBED and bool((values.phase["V_ms"] > self._threshold).any())
        if not due and exceeds and (_BRIEF not in values.flags or self._follows):
            self._left, due = self._seconds, True
        self._follows = exceeds
        if not due:
            return values
        self._left -= values.duration
        return replace(values, flags=values.flags | {SIGNALLING})


def telegram_only(values: QualityValues) -> QualityValues:
    """What a recording needs of a value."""
    return replace(values, phase={name: values.phase[name] for name in _RECORDED}, system={})
