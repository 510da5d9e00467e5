"""Rows of two daemons under one name: two boots of a device that go on at the same time.

A daemon that is started again has a boot that begins where the one before has ended, and sends what waited of that one:
its times end before the new boot begins. Two daemons overlap.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

FLAG = "two_boots"
"""Of rows that came while another boot of their device went on."""
_OVERLAP = 10_000_000
"""Ticks by which a boot goes on after the begin of another: a clock is set, a window is on its way."""
_TOGETHER = 50_000_000
"""Newest rows of two that run now are not further apart [ticks], or a clock is wrong."""
_LATELY_S = 10.0
_MOST_BOOTS, _MOST_DEVICES = 8, 4_096


@dataclass(slots=True)
class _Boot:
    first: int
    newest: int
    heard: float


class BootWatch:
    """Hears all rows; for one thread."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._boots: OrderedDict[str, OrderedDict[str, _Boot]] = OrderedDict()
        self._mixed: dict[str, tuple[float, str]] = {}

    @property
    def trouble(self) -> str:
        """Which devices have two daemons, else empty."""
        now = self._now()
        for device, (until, boots) in list(self._mixed.items()):
            if until < now:
                del self._mixed[device]
            else:
                return f"two daemons publish as device {device} (boots {boots}); their rows are flagged {FLAG}"
        return ""

    def hear(self, device: str, boot: str, first: int, newest: int) -> bool:
        """Rows of a boot come, from and to these times (`filetime`); whether another boot of the device goes on."""
        boot, now = boot.partition(".")[0], self._now()  # `boot.1` is the same daemon, whose clock was set back
        boots = self._boots.get(device)
        if boots is None:
            boots = self._boots[device] = OrderedDict()
            if len(self._boots) > _MOST_DEVICES:
                self._boots.popitem(last=False)
        mine = boots.get(boot)
        if mine is None:
            mine = boots[boot] = _Boot(first, newest, now)
            if len(boots) > _MOST_BOOTS:
                boots.popitem(last=False)
        mine.first, mine.newest, mine.heard = min(mine.first, first), max(mine.newest, newest), now
        if len(boots) == 1:
            return False
        for name, other in boots.items():
            if (
                other is not mine
                and now - other.heard < _LATELY_S
                and newest - other.first > _OVERLAP
                and other.newest - mine.first > _OVERLAP
                and abs(newest - other.newest) < _TOGETHER
            ):
                self._mixed[device] = now + _LATELY_S, " and ".join(sorted((boot, name)))
        mixed = self._mixed.get(device)
        return mixed is not None and mixed[0] >= now
