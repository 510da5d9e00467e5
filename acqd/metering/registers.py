"""Registers of reactive energy in four quadrants, and of the demand of quarter hours.

Quadrants are those of IEC 62053-23: I import and inductive, II export and Q > 0, III export and
Q < 0, IV import and capacitive. A window counts as a whole, in the quadrant of its P and the Q1 of its fundamentals:
kvarh = |Q1| x window / 3.6e6. The total of several phases counts by their sums.

Demand is the mean imported power of blocks of 15 min of UTC. A block that lacks windows has none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from acqd.metering.window import WindowBatch, windows_of

BLOCK_S = 900
"""Of the demand."""
_WHOLE = 0.999
"""Share of a block that must be metered."""
_QUADRANTS = ("I", "II", "III", "IV")
_NUMBERS = 8
"""Of a channel in the state."""


def quadrant(P: float, Q: float) -> int:
    """0 to 3 for I to IV."""
    return (0 if P >= 0 else 1) if Q >= 0 else (3 if P >= 0 else 2)


@dataclass(slots=True)
class Channel:
    """Registers of one phase, or of all phases together."""

    reactive: list[float] = field(default_factory=lambda: [0.0] * 4)
    """kvarh of quadrants I to IV."""
    kWh: float = 0.0
    """Imported in the block in progress."""
    last_W: float | None = None
    """Demand of the last block."""
    most_W: float | None = None
    """Largest demand."""
    most_block: int | None = None
    """Number of that block since 1970."""


class Registers:
    """Of one stream; `state` continues after a restart."""

    def __init__(self, phases: int, window_s: float, creep_W: float = 0.0, state: Any = None) -> None:
        """`creep_W` [var] of a phase below which Q1 does not count. Raises ValueError for a state that is none."""
        names = [f"L{k + 1}" for k in range(phases)] + (["total"] if phases > 1 else [])
        self._phases, self._window_s, self._creep = phases, window_s, creep_W
        self._block, self._covered_s = -1, 0.0
        self._before: list[float] | None = None
        self.channels = {name: Channel() for name in names}
        if state is not None:
            self._restore(state)

    def add(self, batch: WindowBatch) -> None:
        """Count windows."""
        for one in windows_of(batch):
            count = len(one.readings) // 2
            imported = one.readings[:count]
            self._to_block(one.utc_ns // (BLOCK_S * 10**9))
            self._count_reactive(one.quantities[2 * count : 3 * count], one.quantities[3 * count :])
            if self._before is not None:
                self._covered_s += self._window_s
                self._count_demand([now - before for now, before in zip(imported, self._before, strict=True)])
            self._before = imported

    def reading(self, channel: str) -> dict[str, float | int | None]:
        """What a summary says: kvarh, W, start of the block with the largest demand [s since 1970]."""
        one = self.channels[channel]
        named = {f"W_reactive_{name}": kvarh for name, kvarh in zip(_QUADRANTS, one.reactive, strict=True)}
        start = None if one.most_block is None else one.most_block * BLOCK_S
        return {**named, "P_demand": one.last_W, "P_demand_max": one.most_W, "P_demand_max_start": start}

    def state(self) -> dict[str, Any]:
        """As JSON."""
        channels = {
            name: [*one.reactive, one.kWh, one.last_W, one.most_W, one.most_block]
            for name, one in self.channels.items()
        }
        return {"block": self._block, "covered_s": self._covered_s, "channels": channels}

    def numbers(self) -> list[float]:
        """The state as numbers, NaN for what is not known: small enough to be kept with every window."""
        result = [float(self._block), self._covered_s]
        for one in self.channels.values():
            rest = [one.last_W, one.most_W, one.most_block]
            result += [*one.reactive, one.kWh, *[math.nan if value is None else value for value in rest]]
        return result

    def advance(self, numbers: Sequence[float]) -> None:
        """To a later state, as `numbers` gave it. Registers only rise: what is less there stays as it is.

        Raises ValueError for numbers of other channels, or impossible ones.
        """
        if len(numbers) != 2 + _NUMBERS * len(self.channels):
            raise ValueError(f"registers: {len(numbers)} numbers are not of {len(self.channels)} channels")
        block, covered_s = _reading(numbers[0] + 1) - 1, _reading(numbers[1])
        newer = (block, covered_s) > (self._block, self._covered_s)
        for k, one in enumerate(self.channels.values()):
            *values, last, most, most_block = numbers[2 + _NUMBERS * k : 2 + _NUMBERS * (k + 1)]
            reactive = [_reading(value) for value in values[:4]]
            one.reactive = [max(pair) for pair in zip(one.reactive, reactive, strict=True)]
            if newer:
                one.kWh, one.last_W = _reading(values[4]), _unless_nan(last)
            if most == most and (one.most_W is None or most > one.most_W):
                one.most_W, one.most_block = _reading(most), int(_reading(most_block))
        if newer:
            self._block, self._covered_s = int(block), covered_s

    def _restore(self, state: Any) -> None:
        try:
            self._block, self._covered_s = int(state["block"]), float(state["covered_s"])
            for name, one in self.channels.items():
                *reactive, kWh, last, most, block = state["channels"][name]
                one.reactive = [_reading(value) for value in reactive]
                one.kWh, one.last_W, one.most_W = _reading(kWh), _optional(last), _optional(most)
                one.most_block = None if block is None else int(block)
                if len(reactive) != len(_QUADRANTS):
                    raise ValueError("not four quadrants")
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"registers: {error!r}") from None

    def _to_block(self, block: int) -> None:
        if block == self._block:
            return
        whole = self._covered_s >= _WHOLE * BLOCK_S
        for one in self.channels.values():
            one.last_W = one.kWh * 1000 * 3600 / BLOCK_S if whole and block == self._block + 1 else None
            if one.last_W is not None and (one.most_W is None or one.last_W > one.most_W):
                one.most_W, one.most_block = one.last_W, self._block
            one.kWh = 0.0
        self._block, self._covered_s = block, 0.0

    def _count_reactive(self, P: list[float], Q: list[float]) -> None:
        counted = [q if abs(q) >= self._creep else 0.0 for q in Q]  # NaN: 0, too
        both = list(zip(P, counted, strict=True))
        if self._phases > 1:
            both.append((math.fsum(P), math.fsum(counted)))
        for one, (p, q) in zip(self.channels.values(), both, strict=True):
            if q:
                one.reactive[quadrant(p, q)] += abs(q) * self._window_s / 3.6e6

    def _count_demand(self, kWh: list[float]) -> None:
        every = [*kWh, sum(kWh)] if self._phases > 1 else kWh
        for one, more in zip(self.channels.values(), every, strict=True):
            one.kWh += more


def _reading(value: Any) -> float:
    number = float(value)
    if not 0 <= number < 1e15:
        raise ValueError(f"impossible reading {number}")
    return number


def _unless_nan(value: float) -> float | None:
    return _reading(value) if value == value else None


def _optional(value: Any) -> float | None:
    return None if value is None else _reading(value)
