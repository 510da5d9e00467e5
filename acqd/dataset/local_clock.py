"""Times without a zone: those of a named zone, or of an unnamed clock that may go back by an hour once."""

from __future__ import annotations

from datetime import UTC, datetime
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np

from acqd.errors import UserError
from acqd.timestamps import Nanoseconds

_HOUR_NS = 3_600_000_000_000
_ROWS_NS = 120_000_000_000
"""By so much the step back may differ from an hour: rows are seldom farther apart."""


class LocalClock:
    """Converts the times of one file, in the order of its rows, to UTC.

    At the end of summer time a local clock shows one hour twice. Sorted, the second hour would mix with the first, and
    rows of the same time would be dropped as duplicates; the order of the rows tells them apart.
    """

    def __init__(self, origin: str, zone: str | None) -> None:
        """Raises UserError for an unknown zone."""
        self._origin, self._zone = origin, None
        if zone is not None:
            try:
                self._zone = ZoneInfo(zone)
            except (ZoneInfoNotFoundError, ValueError, OSError):
                raise UserError(f"zone {zone!r} is unknown; expected a name such as Europe/Berlin, or UTC") from None
        self._used, self._back, self._latest = False, 0, 0

    def utc(self, local_ns: Nanoseconds) -> Nanoseconds:
        """Times [n] of the next rows as UTC, without a zone as the times of a clock that never goes back."""
        if not len(local_ns):
            return local_ns
        steps = np.diff(local_ns, prepend=self._latest if self._used else local_ns[0])
        self._used, self._latest = True, int(local_ns[-1])
        back = np.abs(steps + _HOUR_NS) < _ROWS_NS
        turned = self._back + np.cumsum(back)
        self._back = int(turned[-1])
        if self._zone is None:
            return np.asarray(local_ns + _HOUR_NS * turned)
        return np.asarray(local_ns - self._offsets(local_ns, turned > 0))

    def notes(self) -> list[str]:
        """What the user should know; empty where the zone of every time is known, and a zone that is given is used."""
        if not self._used and self._zone is not None:
            return [f"power {self._origin}: its times name their zone, or count from 1970: --zone is not used"]
        if not self._used or self._zone is not None:
            return []
        note = f"power {self._origin}: its times have no zone and are taken for UTC; --zone Europe/Berlin would say it"
        if self._back:
            note += (
                "; the clock goes back by an hour, at the end of summer time: the rows behind count as one hour later"
            )
        return [note]

    def _offsets(self, local_ns: Nanoseconds, second: np.ndarray) -> Nanoseconds:
        """[n] ns that local time is ahead of UTC; `second` [n]: behind the step back, the later of two readings."""
        assert self._zone is not None
        quarters = local_ns // (_HOUR_NS // 4)  # offsets change at whole quarters of an hour
        offsets = np.empty(len(local_ns), dtype=np.int64)
        for fold in (0, 1):
            chosen = second == bool(fold)
            for quarter in np.unique(quarters[chosen]).tolist():
                moment = datetime.fromtimestamp(quarter * 900, UTC).replace(tzinfo=self._zone, fold=fold)
                shift = moment.utcoffset()
                assert shift is not None
                offsets[chosen & (quarters == quarter)] = round(shift.total_seconds()) * 1_000_000_000
        return offsets
