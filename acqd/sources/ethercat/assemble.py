"""Blocks of all terminals put together: one array of codes per SYNC1 period, with its flags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.metering.block import Codes
from acqd.sources import el3783
from acqd.sources.ethercat.layout import Block
from acqd.sources.ethercat.sample_count import SampleCount
from acqd.sources.ethercat.settings import EthercatSettings

_KEPT = 4  # blocks kept per terminal until the other terminals deliver theirs
_CHANNEL = ("U1", "I1", "U2", "I2", "U3", "I3")


@dataclass(frozen=True, slots=True)
class Assembled:
    """One SYNC1 period of the stream."""

    codes: Codes
    """[N, 2 * phases]."""
    begin_ns: int
    """DC time of the first sample."""
    flags: frozenset[str]
    warning: str
    """What is wrong with the samples although they arrived; empty: nothing."""


class Assembler:
    """Takes process images in, gives each period once; repeated images of a period are passed over."""

    def __init__(self, settings: EthercatSettings, block_ns: int, samples: int = 0, count_bytes: int = 2) -> None:
        """`samples` of a block; `count_bytes` of SampleCount."""
        self._settings = settings
        self._places = settings.places()
        self._block_ns = block_ns
        self._waiting: list[dict[int, Block]] = [{} for _ in range(settings.terminals)]
        self._known = [SampleCount(samples, count_bytes) for _ in range(settings.terminals)]
        self._last_ns: int | None = None  # NextSync1Time of the last period

    def add(self, blocks: list[Block]) -> list[Assembled]:
        """The periods that the blocks of one exchange complete, oldest first."""
        for waiting, block in zip(self._waiting, blocks, strict=True):
            if block.next_sync1_ns and (self._last_ns is None or block.next_sync1_ns > self._last_ns):
                waiting[block.next_sync1_ns] = block
                for old in sorted(waiting)[:-_KEPT]:
                    del waiting[old]
        complete = sorted(set.intersection(*(set(waiting) for waiting in self._waiting)))
        return [self._assemble(time) for time in complete]

    def _assemble(self, time: int) -> Assembled:
        blocks = [waiting[time] for waiting in self._waiting]
        for waiting in self._waiting:
            for done in [key for key in waiting if key <= time]:
                del waiting[done]
        flags, warnings = set(), []
        for number, block in enumerate(blocks):
            named, warning = self._judge(number, block)
            flags |= named
            warnings += warning
        if self._miscounted(time, [block.count for block in blocks]):
            flags.add("sync_error")
        return Assembled(self._codes(blocks), time - self._block_ns, frozenset(flags), "; ".join(warnings))

    def _codes(self, blocks: list[Block]) -> Codes:
        columns: list[NDArray[np.int16 | np.int32]] = []
        for terminal, phase in self._places:
            block = blocks[terminal]
            columns += [block.samples[2 * phase], self._current(block, phase)]
        return np.stack(columns, axis=1)  # int32 as soon as one column is

    def _current(self, block: Block, phase: int) -> NDArray[np.int16 | np.int32]:
        """Codes of one current; with automatic range in digits of the 1 A range, whichever range they were taken in."""
        codes: NDArray[np.int16 | np.int32] = block.samples[2 * phase + 1]
        if self._settings.current_range == "auto":
            gain = np.int32(1 if (block.fine_range or 0) >> phase & 1 else el3783.AUTO_GAIN)
            codes = np.multiply(codes, gain, dtype=np.int32)
        return codes

    def _judge(self, terminal: int, block: Block) -> tuple[set[str], list[str]]:
        """Row flags and warnings of one terminal's metered channels."""
        phases = [phase for which, phase in self._places if which == terminal]
        channels = [2 * phase + k for phase in phases for k in (0, 1)]
        status = int(np.bitwise_or.reduce(block.status[channels])) if channels else 0
        flags, warnings = set(el3783.status_flags(status)), []
        if "sync_error" in flags:
            warnings.append(f"terminal {terminal + 1} reports a synchronisation error; check SYNC0/SYNC1 and the cycle")
        if "invalid" in flags:
            bad = [_CHANNEL[c] for c in channels if "invalid" in el3783.status_flags(int(block.status[c]))]
            warnings.append(f"terminal {terminal + 1} marks {', '.join(bad)} as invalid")
        expected = {"1A": 1, "5A": 0}.get(self._settings.current_range)
        fine = block.fine_range
        if expected is not None and fine is not None and any(fine >> phase & 1 != expected for phase in phases):
            flags.add("invalid")
            measured = "5A" if expected else "1A"
            warnings.append(
                f"terminal {terminal + 1} measures currents in its {measured} range, "
                f'source.current_range is "{self._settings.current_range}"'
            )
        return flags, warnings

    def _miscounted(self, time: int, counts: list[int]) -> bool:
        """Whether the terminals' counts contradict the distributed clock."""
        last, self._last_ns = self._last_ns, time
        periods = 0 if last is None else round((time - last) / self._block_ns)
        wrong = [known.contradicts(now, periods) for known, now in zip(self._known, counts, strict=True)]
        return any(wrong)
