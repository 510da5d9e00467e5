"""How long an answer may take (ADR 67)."""

from __future__ import annotations

LEAST_S, LONGEST_S = 5.0, 60.0


class Patience:
    """Twice as long as the last answer took; doubled while none comes.

    With a fixed limit, a way that takes longer is filled with what is already on it, and slows down further: as in a
    congestion collapse, it never catches up. TCP waits for its acknowledgements in the same manner (RFC 6298).
    """

    def __init__(self) -> None:
        self.s = LEAST_S
        """The longest time that an answer may take now [s]."""

    def answered(self, after_s: float) -> None:
        """An answer has come."""
        self.s = min(max(LEAST_S, 2 * after_s), LONGEST_S)

    def missed(self) -> None:
        """None has come in time."""
        self.s = min(2 * self.s, LONGEST_S)
