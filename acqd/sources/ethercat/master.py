"""The segment through pysoem: from an interface's name to terminals that deliver blocks."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pysoem

from acqd.errors import UserError
from acqd.sources.ethercat import objects
from acqd.sources.ethercat.layout import BlockLayout, build_layout
from acqd.sources.ethercat.settings import OVERSAMPLING, RANGE_CODE, EthercatSettings
from acqd.sources.interfaces import check_interface

_STATE_US = 200_000  # for one change of state
_OP_TRIES = 60


class SegmentError(Exception):
    """The segment does not do what it should; one line. Worth another try later."""


@dataclass(frozen=True, slots=True)
class SlaveInfo:
    """One slave of a scan."""

    position: int
    vendor: int
    product: int
    revision: int
    name: str

    @property
    def title(self) -> str:
        """Its type for people."""
        return objects.product_name(self.vendor, self.product)


def open_master(interface: str, option: str = "source.interface") -> Any:
    """A pysoem master on the interface. Raises UserError, which names `option`, when that is impossible here."""
    check_interface(interface, option)
    master = pysoem.Master()
    try:
        master.open(interface)
    except ConnectionError:
        raise UserError(
            f"{option}: this user may not send EtherCAT frames on {interface}; give the service CAP_NET_RAW "
            "and CAP_NET_ADMIN (AmbientCapabilities= in its unit, or setcap cap_net_raw,cap_net_admin+ep on its Python)"
        ) from None
    master.manual_state_change = True
    return master


def scan(master: Any) -> list[SlaveInfo]:
    """All slaves of the segment, in their order. Raises SegmentError when none answers."""
    if master.config_init() <= 0:
        raise SegmentError("no EtherCAT slave answers; check cable, power and the interface")
    return [
        SlaveInfo(position, slave.man, slave.id, slave.rev, slave.name)
        for position, slave in enumerate(master.slaves, start=1)
    ]


def assignments(master: Any) -> dict[int, list[str]]:
    """The PDOs assigned to the inputs of each EL3783 by position, a line each. Raises SegmentError."""
    lines: dict[int, list[str]] = {}
    for position, slave in enumerate(master.slaves, start=1):
        if (slave.man, slave.id) == (objects.BECKHOFF, objects.EL3783):
            with _sdo_errors():
                lines[position] = [
                    f"{pdo:#06x}: {sum(entry & 0xFF for entry in entries)} bits in {len(entries)} entries"
                    for pdo in _list(slave, objects.TXPDO_ASSIGN)
                    for entries in [_list(slave, pdo)]
                ]
    return lines


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
            terminals = _find_terminals(master, settings)
            layouts = _configure(master, terminals, settings)
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
        """Leave the terminals in INIT and the interface alone."""
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
        for _ in range(_OP_TRIES):
            self._master.send_processdata()
            self._master.receive_processdata(self._receive_us)
            if self._master.state_check(state, 10_000) == state:
                return
        self._master.read_state()
        raise SegmentError(f"the segment does not reach {name}: {self.diagnose()}")


def close_master(master: Any) -> None:
    """Ask for INIT, then close; a dead segment does not matter any more."""
    with contextlib.suppress(Exception):  # pysoem raises bare exceptions of several kinds here
        master.state = pysoem.INIT_STATE
        master.write_state()
    with contextlib.suppress(Exception):
        master.close()


def _find_terminals(master: Any, settings: EthercatSettings) -> list[Any]:
    slaves = scan(master)
    found = [
        slave
        for slave, info in zip(master.slaves, slaves, strict=True)
        if (info.vendor, info.product) == (objects.BECKHOFF, objects.EL3783)
    ]
    if len(found) != settings.terminals:
        there = ", ".join(f"{info.position}: {info.title}" for info in slaves)
        raise UserError(
            f"source.terminals: expected {settings.terminals} EL3783 on {settings.interface}, "
            f"found {len(found)} ({there})"
        )
    return found


def _configure(master: Any, terminals: list[Any], settings: EthercatSettings) -> list[BlockLayout]:
    """PRE-OP: range, PDO assignment, layout as read back, and the mapping of the process image."""
    samples_pdo = OVERSAMPLING.index(settings.samples())
    if master.state_check(pysoem.PREOP_STATE, _STATE_US) != pysoem.PREOP_STATE:
        master.state = pysoem.PREOP_STATE
        master.write_state()
        if master.state_check(pysoem.PREOP_STATE, 10 * _STATE_US) != pysoem.PREOP_STATE:
            raise SegmentError("the segment does not reach PRE-OP; power it off and on")
    with _sdo_errors():
        layouts = [_prepare(terminal, samples_pdo, settings) for terminal in terminals]
    try:
        master.config_map()
    except pysoem.ConfigMapError as error:
        raise SegmentError(f"the process image cannot be mapped ({error})") from None
    for terminal, layout in zip(terminals, layouts, strict=True):
        # A lost SDO reply makes SOEM take a wrong size without a word.
        if len(terminal.input) != layout.size:
            raise SegmentError(f"{terminal.name} maps {len(terminal.input)} bytes, its objects say {layout.size}")
    return layouts


def _prepare(terminal: Any, samples_pdo: int, settings: EthercatSettings) -> BlockLayout:
    if settings.range_object:
        _set_range(terminal, settings)
    wanted = objects.assignment(samples_pdo)
    terminal.sdo_write(objects.TXPDO_ASSIGN, 0, bytes([0]))
    for number, pdo in enumerate(wanted, start=1):
        terminal.sdo_write(objects.TXPDO_ASSIGN, number, pdo.to_bytes(2, "little"))
    terminal.sdo_write(objects.TXPDO_ASSIGN, 0, bytes([len(wanted)]))
    assigned = _list(terminal, objects.TXPDO_ASSIGN)
    if assigned != wanted:
        raise SegmentError(f"{terminal.name} did not keep its PDO assignment; power it off and on")
    return build_layout(assigned, lambda pdo: _list(terminal, pdo))


def _set_range(terminal: Any, settings: EthercatSettings) -> None:
    index, _, subindex = settings.range_object.partition(":")
    try:
        terminal.sdo_write(int(index, 16), int(subindex, 16), bytes([RANGE_CODE[settings.current_range]]))
    except pysoem.SdoError as error:
        raise UserError(
            f"source.range_object: {terminal.name} refuses object {settings.range_object} ({error.desc}); give the one "
            "of its manual, or set the range in TwinCAT and leave range_object empty"
        ) from None


def _list(terminal: Any, index: int) -> list[int]:
    """Entries of an object whose subindex 0 counts them."""
    count = int.from_bytes(terminal.sdo_read(index, 0), "little")
    return [int.from_bytes(terminal.sdo_read(index, number), "little") for number in range(1, count + 1)]


@contextlib.contextmanager
def _sdo_errors() -> Iterator[None]:
    try:
        yield
    except pysoem.SdoError as error:
        raise SegmentError(
            f"slave {error.slave_pos} refuses an object: {error.desc}; is its firmware current?"
        ) from None
    except (pysoem.MailboxError, pysoem.PacketError, pysoem.WkcError) as error:
        raise SegmentError(
            f"the mailbox does not answer ({type(error).__name__}); power the segment off and on"
        ) from None
