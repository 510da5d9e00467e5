"""State machine of a slave (ETG.1000.6, 6.4): INIT, PRE-OP, SAFE-OP, OP, and the AL status code of a refusal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from .registers import AL_CODE, AL_CONTROL, AL_STATUS, U16

INIT: Final = 1
PREOP: Final = 2
BOOT: Final = 3
SAFEOP: Final = 4
OP: Final = 8
ERROR: Final = 0x10
"""Error indication in AL status, acknowledgement in AL control."""

INVALID_CHANGE: Final = 0x0011
UNKNOWN_STATE: Final = 0x0012
NO_BOOTSTRAP: Final = 0x0013
INVALID_MAILBOX: Final = 0x0016
INVALID_INPUTS: Final = 0x001E
INVALID_MAPPING: Final = 0x0024
INVALID_SYNC: Final = 0x0030

ORDER: Final = (INIT, PREOP, SAFEOP, OP)


class StateMachine:
    """AL control, AL status and AL status code of one slave.

    `check(wanted)` returns the AL status code that refuses the next higher state, or 0.
    """

    def __init__(self, memory: bytearray, check: Callable[[int], int]) -> None:
        self._memory = memory
        self._check = check
        self.state = INIT
        self._code = 0
        self._failed = False
        self.publish()

    def request(self) -> None:
        """Act on what the master wrote into AL control."""
        control = U16.unpack_from(self._memory, AL_CONTROL)[0]
        wanted = control & 0x0F
        if self._failed and not control & ERROR and wanted > self.state:
            return
        self._failed, self._code = False, 0
        code = self._refusal(wanted)
        if code:
            self.fail(code)
        else:
            self.state = wanted
        self.publish()

    def fail(self, code: int) -> None:
        """Fall to SAFE-OP where the slave was in OP, and indicate the error `code`."""
        self.state = min(self.state, SAFEOP)
        self._failed, self._code = True, code
        self.publish()

    def reset(self) -> None:
        """State after power-on."""
        self.state, self._code, self._failed = INIT, 0, False
        self.publish()

    def _refusal(self, wanted: int) -> int:
        if wanted not in ORDER:
            return NO_BOOTSTRAP if wanted == BOOT else UNKNOWN_STATE
        if wanted <= self.state:
            return 0
        if ORDER.index(wanted) > ORDER.index(self.state) + 1:
            return INVALID_CHANGE
        return self._check(wanted)

    def publish(self) -> None:
        """Write AL status and AL status code into the registers."""
        U16.pack_into(self._memory, AL_STATUS, self.state | (ERROR if self._failed else 0))
        U16.pack_into(self._memory, AL_CODE, self._code)
