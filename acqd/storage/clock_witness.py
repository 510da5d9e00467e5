"""Whether a row's time can be true: this computer's clock is one witness among several, not the judge (ADR 30).

A clock without a battery starts years ago; one that is set by hand may be days ahead. A row from more than a day ahead
of this clock is *doubtful* where another witness says that this clock is behind: the sink's own record that it has
been later before, other devices that agree with the row, or a row whose clock is disciplined while this one is not. It
is stored then, with a flag. Otherwise the row is impossible, and waits in quarantine for a person.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from typing import Literal

from acqd.storage.state import Mark
from acqd.timestamps import rfc3339, utc_ns
from acqd.uptime import Moment, moment

FLAG = "sink_clock"
"""Of rows that were stored although this computer's clock says that their time has not come."""
IMPOSSIBLE = "impossible time: "
"""How the reasons of such rows in quarantine begin."""
AHEAD_NS = 86_400 * 10**9
"""A row from further ahead would make what is asked for "until the newest row" wrong for as long."""
_AGREE_NS = 60 * 10**9
_HEARD_S = 60.0
_MOST_DEVICES = 4_096
_BACK_NS = 3_600 * 10**9
"""A clock that goes back by less is no news: leap seconds, corrections, drift while the computer was off."""
_UNSYNCHRONISED = "unsynchronised"
Judgement = Literal["plausible", "doubtful"]


class ClockWitness:
    """Hears the rows of all devices, then judges them; for one thread."""

    def __init__(
        self,
        synchronised: Callable[[], bool | None] = lambda: None,
        now_ns: Callable[[], int] = time.time_ns,
        elapsed: Callable[[], Moment] = moment,
    ) -> None:
        """`synchronised`: whether the kernel holds this computer's clock for disciplined; None: nobody can tell."""
        self._synchronised, self._now_ns, self._elapsed = synchronised, now_ns, elapsed
        self._latest: Mark | None = None
        self._now = self._estimate = 0
        self._offsets: dict[str, tuple[int, float]] = {}
        self.trouble = ""
        """What is wrong with this computer's clock, else empty."""

    def remember(self, mark: Mark | None) -> None:
        """What the database says of an earlier commit."""
        if mark is not None and (self._latest is None or mark.wall_ns > self._latest.wall_ns):
            self._latest = mark

    def mark(self, number: int) -> Mark:
        """The clocks now, for the commit `number`."""
        return Mark(number, self._estimate, self._elapsed())

    def look(self) -> None:
        """Read the clocks, once for a batch."""
        self._now, elapsed = self._now_ns(), self._elapsed()
        estimate = self._latest.estimate_ns(elapsed) if self._latest is not None else self._now
        if estimate - self._now > _BACK_NS and self._synchronised():
            estimate = self._now  # the record is of a time when nobody disciplined the clock, and it was ahead
        self._estimate = max(self._now, estimate)
        self._latest = Mark(0, self._estimate, elapsed)
        behind = self._estimate - self._now
        self.trouble = (
            f"this computer's clock was set back: it says {rfc3339(self._now, 0)}, and has been at "
            f"{rfc3339(self._estimate, 0)} or later; set it (chrony, timedatectl), rows are stored and flagged {FLAG}"
            if behind > _BACK_NS
            else ""
        )

    def hear(self, device: str, filetime: int) -> None:
        """The time of a row, before the rows of its batch are judged."""
        if device in self._offsets or len(self._offsets) < _MOST_DEVICES:
            self._offsets[device] = utc_ns(filetime) - self._now, time.monotonic()

    def all_plausible(self, filetimes: Sequence[int]) -> bool:
        """Whether no row with one of these times has to be judged."""
        return not filetimes or (utc_ns(min(filetimes)) >= 0 and utc_ns(max(filetimes)) - self._now <= AHEAD_NS)

    def judge(self, device: str, row_filetime: int, text: str, flags: Collection[str]) -> Judgement:
        """`text` is the row's time as it says it. Raises ValueError for an impossible time."""
        row_ns = utc_ns(row_filetime)
        if row_ns < 0:
            raise ValueError(f"{IMPOSSIBLE}{text} is before 1970")
        ahead = row_ns - self._now
        if ahead <= AHEAD_NS:
            return "plausible"
        if row_ns <= self._estimate + AHEAD_NS:
            return "doubtful"
        if self._others_agree(device, ahead) or (_UNSYNCHRONISED not in flags and self._synchronised() is False):
            self.trouble = (
                f"this computer's clock says {rfc3339(self._now, 0)}, and rows say {text}: it is behind; set it "
                f"(chrony, timedatectl), rows are stored and flagged {FLAG}"
            )
            return "doubtful"
        raise ValueError(f"{IMPOSSIBLE}{text} is more than a day ahead of this computer's clock")

    def _others_agree(self, device: str, ahead: int) -> bool:
        """Whether at least two other devices, and most of all that were heard, have a clock that agrees."""
        now = time.monotonic()
        heard = [offset for offset, at in self._offsets.values() if now - at <= _HEARD_S]
        agree = [
            name
            for name, (offset, at) in self._offsets.items()
            if name != device and now - at <= _HEARD_S and abs(offset - ahead) <= _AGREE_NS
        ]
        return len(agree) >= 2 and 2 * (len(agree) + 1) > len(heard)
