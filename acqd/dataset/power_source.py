"""Blocks of power rows as they come from a database or a file, and the choice of device and channel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.timestamps import Nanoseconds

BLOCK_ROWS = 100_000
_UNUSABLE = frozenset({"gap", "overrange", "no_mains", "invalid", "stale", "test"})
"""P of rows with one of these flags cannot be used."""


@dataclass(frozen=True, slots=True)
class PowerRows:
    """A block of rows of one channel, in any order."""

    time_ns: Nanoseconds
    P: Floats
    Vrms: Floats
    flags: frozenset[str]
    """Flags that occur in the block."""
    without_zone: bool = False
    """Whether the times are those of a clock on a wall, written without a zone."""

    @classmethod
    def of(
        cls,
        time_ns: Nanoseconds,
        P: object,
        Vrms: object,
        flags: Sequence[tuple[str, ...]],
        *,
        without_zone: bool = False,
    ) -> PowerRows:
        """From sequences of one value, or the names of the flags, per row; P of unusable rows becomes NaN."""
        values, volts = np.array(P, dtype=np.float64), np.array(Vrms, dtype=np.float64)
        different = set(flags)  # a handful in a day of rows
        unusable = {names for names in different if _UNUSABLE.intersection(names)}
        if unusable:
            values[[names in unusable for names in flags]] = np.nan
        return cls(time_ns, values, volts, frozenset().union(*different), without_zone)


def choose(origin: str, present: set[tuple[str, str]], device: str | None, channel: str | None) -> tuple[str, str]:
    """Device and channel among the present pairs: the only device, and total, or the only one. Raises UserError."""
    devices = sorted({name for name, _ in present})
    if not devices:
        raise UserError(f"power {origin}: holds no rows")
    if device is None and len(devices) > 1:
        raise UserError(f"power {origin}: holds several devices; choose one with --device: {', '.join(devices)}")
    for option, name, known in (("device", device, devices), ("channel", channel, {each for _, each in present})):
        if name and set(known) == {""}:
            raise UserError(f"power {origin}: has no column {option}; leave --{option} out")
    device = device or devices[0]
    channels = sorted(name for owner, name in present if owner == device)
    if not channels:
        raise UserError(f"power {origin}: has no device {device!r}; it has {', '.join(devices)}")
    if channel is None and len(channels) > 1 and "total" not in channels:
        raise UserError(
            f"power {origin}: {device} has no total, but {', '.join(channels)}: choose one with --channel, or add rows "
            "of their sum with the channel total"
        )
    channel = channel or ("total" if "total" in channels else channels[0])
    if channel not in channels:
        raise UserError(f"power {origin}: {device} has no channel {channel!r}; it has {', '.join(channels)}")
    return device, channel
