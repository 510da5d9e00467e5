"""EK1100 coupler and EL3783 power-measuring terminal (Beckhoff manuals; ESI for identities and PDOs)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tests.doubles.waveform import WaveTable

from . import sii
from .clock import Clock
from .coe import SdoServer
from .esc import INPUTS, SlaveController
from .image import Block, Layout, MappingError, layout
from .objects import CHANNELS, RANGE_1A, Firmware, TerminalObjects
from .registers import U16
from .states import INVALID_INPUTS, INVALID_MAILBOX, INVALID_MAPPING, INVALID_SYNC, PREOP, SAFEOP

BECKHOFF: Final = 0x2
EK1100: Final = sii.Identity(BECKHOFF, 0x044C2C52, 0x00120000, 0, "EK1100", "SystemBk")
EL3783_PRODUCT: Final = 0x0EC73052
EL3783_REVISION: Final = 0x00120000
MAILBOX_SIZE: Final = 128
MANAGERS: Final = (
    sii.SyncManager(0x1000, MAILBOX_SIZE, 0x26, 1, 1),
    sii.SyncManager(0x1080, MAILBOX_SIZE, 0x22, 1, 2),
    sii.SyncManager(0x1100, 0, 0x24, 0, 3),
    sii.SyncManager(0x1180, 0, 0x20, 1, 4),
)

OVERRANGE: Final = 1 << 1
SYNC_ERROR: Final = 1 << 13
INVALID: Final = 1 << 14
TOGGLE: Final = 1 << 15
FINE_RANGE: Final = 5
"""How much larger the same current's code is in the 1 A range (assumed: exactly five times)."""


class Coupler(SlaveController):
    """EK1100: no mailbox, no process data. Port 0 and 2 are MII, port 1 is the E-bus."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(sii.image(EK1100), clock, 0, 0b00111011)


@dataclass
class Faults:
    """What a test has ordered: `overrange` is a channel 0..5, `ranges` are bits of I1, I2, I3."""

    overrange: int | None = None
    sync_error: bool = False
    invalid: bool = False
    ranges: dict[int, bool] = field(default_factory=dict)


class PowerTerminal(SlaveController):
    """EL3783 number `number` (0, 1, ...) behind the coupler; sends WaveTable(seed=1 + number)."""

    def __init__(
        self, number: int, clock: Clock, product: int = EL3783_PRODUCT, firmware: Firmware | None = None
    ) -> None:
        name = "EL3783" if product == EL3783_PRODUCT else f"EL{product >> 16}"
        identity = sii.Identity(BECKHOFF, product, EL3783_REVISION, number + 1, name, "MeasuringTerminal")
        self._firmware = firmware or Firmware()
        self.objects = TerminalObjects(identity, lambda: self.states.state, self._firmware)
        self._server = SdoServer(self.objects, MAILBOX_SIZE)
        super().__init__(sii.image(identity, MANAGERS), clock, 1 + number, 0b00001010)
        self._table = WaveTable(seed=1 + number)
        self.faults = Faults()
        self._layout = Layout()
        self._origin: int | None = None
        self.shown = -1
        """Number of the block in the process image since SYNC start; -1: none yet."""
        self.held_until = -1
        """Number of the block before which the image does not change."""
        self.sent = 0
        """Blocks that frames took to the master."""
        self.first: int | None = None
        self.last: int | None = None

    @property
    def input_start(self) -> int | None:
        """Logical address of the first input byte, or None where the inputs are not mapped or closed."""
        if not self.inputs_open:
            return None
        return next((fmmu.start for fmmu in self.fmmus if fmmu.inputs and fmmu.reads), None)

    @property
    def period(self) -> int:
        """Duration of one block [ns]; 1 ms as long as no SYNC unit is configured."""
        return self._layout.factor * self.clock.cycle0 if self.clock.start is not None else 1_000_000

    @property
    def synchronous(self) -> bool:
        """Whether the SYNC unit is on and its period is the block's: SYNC1 = (N - 1) * SYNC0."""
        clock = self.clock
        return clock.start is not None and clock.cycle1 == (self._layout.factor - 1) * clock.cycle0

    def answer(self, mail: bytes) -> bytes | None:
        """Answer to a mailbox message; none in INIT."""
        return self._server.answer(mail) if self.states.state >= PREOP else None

    def check(self, wanted: int) -> int:
        """AL status code: mailbox size, mapping and length of the inputs, and the SYNC unit must fit."""
        if wanted == PREOP:
            windows = tuple(self.mailbox.window(k) for k in (0, 1))
            return 0 if all(last - first == MAILBOX_SIZE for first, last in windows) else INVALID_MAILBOX
        if wanted == SAFEOP:
            return self._check_inputs()
        return 0 if self.synchronous else INVALID_SYNC

    def _check_inputs(self) -> int:
        try:
            found = layout(self.objects.assignment(), self._firmware)
        except MappingError:
            return INVALID_MAPPING
        if U16.unpack_from(self.memory, INPUTS + 2)[0] != 2 * found.size:
            return INVALID_INPUTS
        self._layout = found
        self._forget()
        return 0

    def refresh(self) -> None:
        """Put the newest complete block into the inputs' memory."""
        newest = self.clock.newest_block() if self.synchronous else -1
        if newest >= self.held_until and newest != self.shown:
            self.shown = newest
        start = U16.unpack_from(self.memory, INPUTS)[0]
        image = self._layout.image(self._block(self.shown))
        self.memory[start : start + len(image)] = image

    def hold(self, blocks: int) -> None:
        """Show the present block until `blocks` more have passed unseen."""
        self.held_until = max(self.shown, self.clock.newest_block()) + blocks + 1

    def power_cycle(self) -> None:
        """Registers and objects as after power-on; the sample numbers go on with the time."""
        super().power_cycle()
        self.objects.reset()
        self._forget()

    def count(self) -> None:
        """Note that the image went to the master."""
        if self.shown >= 0 and self.shown != self.last:
            self.sent += 1
            self.last = self.shown
            self.first = self.shown if self.first is None else self.first

    def _forget(self) -> None:
        self.shown = self.held_until = -1
        self.first = self.last = None

    def first_sample(self, number: int) -> int:
        """Sample number at the beginning of block `number`: zero at the terminal's first SYNC start."""
        start = self.clock.start or 0
        if self._origin is None:
            self._origin = start
        return (start - self._origin) // self.clock.cycle0 + number * self._layout.factor

    def _block(self, number: int) -> Block:
        ranges = self._ranges()
        if number < 0:
            return Block(None, self._status(INVALID), ranges=ranges)
        next_time = (self.clock.start or 0) + (number + 1) * self.period + self.clock.shift
        status = self._status(TOGGLE if number & 1 else 0)
        step = {"blocks": 1, "samples": self._layout.factor, "nothing": 0}[self._firmware.counts]
        return Block(self._codes(number, ranges), status, next_time % (1 << 64), number * step, 0, ranges)

    def _codes(self, number: int, ranges: int) -> NDArray[np.int16]:
        codes = self._table.codes(self.first_sample(number), self._layout.factor)
        if not ranges:
            return codes
        gains = [FINE_RANGE if c & 1 and ranges >> (c >> 1) & 1 else 1 for c in range(CHANNELS)]
        finer: NDArray[np.int16] = np.clip(codes.astype(np.int32) * gains, -32768, 32767).astype(np.int16)
        return finer

    def _status(self, word: int) -> list[int]:
        faults = self.faults
        word |= INVALID if faults.invalid else 0
        word |= SYNC_ERROR if faults.sync_error or self._out_of_step() else 0
        return [word | (OVERRANGE if channel == faults.overrange else 0) for channel in range(CHANNELS)]

    def _out_of_step(self) -> bool:
        return self.clock.start is not None and not self.synchronous

    def _ranges(self) -> int:
        """Bit k: current k + 1 is in the 1 A range. The automatic choice stays at 5 A until a test changes it."""
        fine = self.objects.range_setting() == RANGE_1A
        return sum(1 << k for k in range(CHANNELS // 2) if self.faults.ranges.get(k, fine))
