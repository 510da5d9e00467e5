"""A segment in OP: cyclic exchange, diagnosis and acknowledgement."""

from __future__ import annotations

from typing import Any

import pysoem

from acqd.sources.ethercat.bus import SegmentError, close_master, open_master, patient
from acqd.sources.ethercat.configure import configure, find_terminals
from acqd.sources.ethercat.layout import BlockLayout
from acqd.sources.ethercat.settings import EthercatSettings

_TRIES = 60  # of a change of state, each with a cyclic frame


class Segment:
    """A configured segment in OP. Made by `Segment.start`."""

    def __init__(self, master: Any, terminals: list[Any], layout: BlockLayout, settings: EthercatSettings) -> None:
        self._master = master
        self._terminals = terminals
        self.layout = layout
        self.sample_ns = settings.sample_ns
        self._receive_us = settings.receive_us

    @classmethod
    def start(cls, settings: EthercatSettings) -> Segment:
        """Open the interface and bring the terminals to OP.

        Raises UserError for what the user must change, SegmentError for what may pass.
        """
        master = open_master(settings.interface)
        try:
            with patient():
                terminals = find_terminals(master, settings)
                layouts = configure(master, terminals, settings)
                segment = cls(master, terminals, layouts[0], settings)
                segment._synchronise()
                segment._operate()
        except BaseException:
            close_master(master)
            raise
        return segment

    @property
    def block_ns(self) -> int:
        """Period of SYNC1 [ns]."""
        return self.layout.oversampling * self.sample_ns

    def exchange(self) -> list[bytes] | None:
        """One cyclic frame; each terminal's process image, None when the working counter is wrong."""
        self._master.send_processdata()
        if self._master.receive_processdata(self._receive_us) != self._master.expected_wkc:
            return None
        return [terminal.input for terminal in self._terminals]

    @property
    def dc_time_ns(self) -> int:
        """Distributed-clock time of the last cyclic frame."""
        return int(self._master.dc_time)

    def trouble(self) -> str | None:
        """Which slave is not in OP, and why; None when all are."""
        if self._master.read_state() == pysoem.OP_STATE:
            return None
        return self.diagnose()

    def diagnose(self) -> str:
        """Why the working counter is wrong; one line."""
        for position, slave in enumerate(self._master.slaves, start=1):
            if slave.state == pysoem.NONE_STATE:
                return f"slave {position} ({slave.name}) does not answer; check cable and power"
            if slave.state != pysoem.OP_STATE:
                text = pysoem.al_status_code_to_string(slave.al_status)
                return f"slave {position} ({slave.name}) left OP: AL status {slave.al_status:#06x} ({text})"
        return "frames are lost; check cable and interface"

    def acknowledge(self) -> bool:
        """Take slaves that fell to SAFE-OP with an error back to OP. False when that is not the trouble."""
        self._master.read_state()
        states = [slave.state for slave in self._master.slaves]
        if not states or any(state & 0x0F not in (pysoem.SAFEOP_STATE, pysoem.OP_STATE) for state in states):
            return False
        for slave in self._master.slaves:
            if slave.state & pysoem.STATE_ERROR:
                slave.state = pysoem.SAFEOP_STATE + pysoem.STATE_ACK
                slave.write_state()
            if slave.state != pysoem.OP_STATE:
                slave.state = pysoem.OP_STATE
                slave.write_state()
        return True

    def close(self) -> None:
        """Leave the terminals in INIT and release the interface."""
        close_master(self._master)

    def _synchronise(self) -> None:
        """SYNC0 is the sampling clock, SYNC1 the block: its register holds (N - 1) x SYNC0."""
        if not self._master.config_dc():
            raise SegmentError("no slave has a distributed clock; is the first one an EK1100 or EL3783?")
        for terminal in self._terminals:
            terminal.dc_sync(True, self.sample_ns, 0, (self.layout.oversampling - 1) * self.sample_ns)

    def _operate(self) -> None:
        self._change(pysoem.SAFEOP_STATE, "SAFE-OP")
        self._change(pysoem.OP_STATE, "OP")

    def _change(self, state: int, name: str) -> None:
        self._master.state = state
        self._master.write_state()
        for _ in range(_TRIES):
            self._master.send_processdata()
            self._master.receive_processdata(self._receive_us)
            if self._master.state_check(state, 10_000) == state:
                return
        self._master.read_state()
        raise SegmentError(f"the segment does not reach {name}: {self.diagnose()}")
