"""What the user says about the terminals, and which cycle follows from it."""

from __future__ import annotations

import resource
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from acqd.errors import UserError
from acqd.numerals import whole_number
from acqd.sources import el3783

OVERSAMPLING = (1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 80, 100)
"""Oversampling factors of the EL3783; the factor's position chooses its samples PDO."""
SHORTEST_NS = 500_000
"""A block shorter than this cannot be read once a cycle from Python [ns]."""
Range = Literal["1A", "5A", "auto"]
RANGE_CODE: dict[Range, int] = {"5A": 0, "1A": 1, "auto": 2}
"""Values of the range object (assumed, not verified on hardware)."""


@dataclass(frozen=True, slots=True)
class EthercatSettings:
    """One to three EL3783 on one network interface."""

    interface: str
    terminals: int = 1
    """EL3783 that must be on the segment."""
    phases: tuple[str, ...] = ("1:L1", "1:L2", "1:L3")
    """terminal:phase of L1, L2, L3 of the rows."""
    oversampling: int = 0
    """Samples a block; 0: 20 where real time is to be had, else 100."""
    sample_ns: int = 50_000
    """Sampling period [ns]."""
    current_range: Range = "5A"
    range_object: str = "F800:01"
    """CoE object (hex index:subindex) of the range, empty: leave the terminal's own setting."""
    receive_us: int = 2_000
    """How long the answer to a frame may take [us]; a later one is lost."""
    f_nominal: float = 50.0
    """Declared mains frequency [Hz]."""
    vt_ratio: float = 1.0
    """Voltage transformer, primary / secondary."""
    ct_ratio: float = 1.0
    """Current transformer, primary / secondary."""

    def places(self) -> list[tuple[int, int]]:
        """(terminal from 0, phase from 0) of each metered phase. Raises UserError."""
        return [self._place(text) for text in self.phases]

    def _place(self, text: str) -> tuple[int, int]:
        terminal, _, phase = text.partition(":")
        number = whole_number(terminal)
        if number is None or phase not in ("L1", "L2", "L3") or not 1 <= number <= self.terminals:
            raise UserError(
                f"source.phases: {text!r} is not like 1:L1, with a terminal from 1 to {self.terminals} "
                "and a phase L1, L2 or L3"
            )
        return number - 1, int(phase[1]) - 1

    def samples(self) -> int:
        """Samples a block: as set, or what suits this host. Raises UserError for a block too short to be read."""
        samples = self.oversampling or (20 if real_time_host() else 100)
        if samples * self.sample_ns < SHORTEST_NS:
            raise UserError(
                f"source.oversampling: {samples} samples of {self.sample_ns} ns make blocks of "
                f"{samples * self.sample_ns / 1e6:g} ms; expected at least {SHORTEST_NS / 1e6:g} ms"
            )
        return samples

    @property
    def scale(self) -> tuple[float, ...]:
        """V or A per digit and channel of the stream."""
        ampere = el3783.I_A_PER_DIGIT[5 if self.current_range == "5A" else 1]
        return (el3783.U_V_PER_DIGIT * self.vt_ratio, ampere * self.ct_ratio) * len(self.phases)


def real_time_host() -> bool:
    """Whether the kernel has PREEMPT_RT and this process may use SCHED_FIFO."""
    kernel = Path("/sys/kernel/realtime")
    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    return kernel.exists() and kernel.read_text().strip() == "1" and (limit != 0)
