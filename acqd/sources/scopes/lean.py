"""RigolWFM without its arrays of times and double numbers, which take twenty times the size of a file of 8 bits.

The library computes them in `Channel`, after a parser has found the codes (or float32 numbers). This class takes its
place while a file is read and keeps what the parser found.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import RigolWFM.channel

_Channel: Any = RigolWFM.channel.Channel
_OF_NUMBERS = ("bin5000", "bin7000_8000", "dho1000", "lecroy", "agilent", "siglent", "rohde_schwarz", "tek", "yokogawa")
"""Methods of the library for families whose parsers give numbers in the unit of the channel."""


class LeanChannel(_Channel):  # type: ignore[misc]
    """value = `codes` x `factor` + `zero`, the first sample at `origin_s` [s] from the trigger."""

    codes: Any = None
    factor, zero, origin_s = 1.0, 0.0, 0.0

    def calc_times_and_volts(
        self, sample_aligned: bool = False, memory_depth_points: int | None = None, midpoint: float = 127.0
    ) -> None:
        """Of codes of 8 bits, as the library's."""
        if not self.enabled_and_selected:
            return
        self.codes, self.factor = self.raw, -float(self.y_scale)
        self.zero = float(self.y_scale) * midpoint - float(self.y_offset)
        whole = self.points if memory_depth_points is None or not sample_aligned else memory_depth_points
        self.origin_s = float(self.time_offset) - whole * float(self.seconds_per_point) / 2

    def _numbers(self, w: Any, channel_number: int) -> None:
        """Of numbers that a parser has made."""
        header, k = w.header, channel_number - 1
        found = header.channel_data[k] if k < len(header.channel_data) else None
        if found is None or not self.enabled_and_selected:
            return
        name = header.ch[k].name if k < len(header.ch) else ""
        if name and not name.startswith("CH"):  # a computed trace
            self.name = name
        self.codes, self.points = np.asarray(found), len(found)
        origins = getattr(header, "x_origins", None)
        origin = origins[k] if isinstance(origins, list) and k < len(origins) and origins[k] is not None else None
        self.origin_s = float(header.x_origin if origin is None else origin)


def _negative_origin(self: LeanChannel, w: Any, channel_number: int) -> None:
    self._numbers(w, channel_number)
    self.origin_s = -self.origin_s


for _name in _OF_NUMBERS:
    setattr(LeanChannel, _name, _negative_origin if _name.startswith("bin") else LeanChannel._numbers)


@contextmanager
def lean_channels() -> Iterator[None]:
    """The library makes these channels."""
    RigolWFM.channel.Channel = LeanChannel
    try:
        yield
    finally:
        RigolWFM.channel.Channel = _Channel
