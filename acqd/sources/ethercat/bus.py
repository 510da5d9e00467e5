"""The segment as pysoem finds it: an interface, slaves and their objects."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pysoem

from acqd.errors import UserError
from acqd.sources.ethercat import objects
from acqd.sources.interfaces import DROP_IN, check_interface

_STATE_US = 2_000_000  # for a change of state
_ANSWER_US = 50_000
"""For the answer to each frame of a start. SOEM waits for 2 ms of wall time: a busy computer looks later for an
answer, and a start takes hundreds of frames, each of which must be answered in time."""


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
            f"and CAP_NET_ADMIN ({DROP_IN}, or setcap cap_net_raw,cap_net_admin+ep on its Python)"
        ) from None
    master.manual_state_change = True
    return master


@contextlib.contextmanager
def patient() -> Iterator[None]:
    """Wait longer for answers to acyclic frames, of all masters of this process: before anything is metered."""
    waits = pysoem.settings.timeouts
    usual = waits.ret, waits.safe, waits.tx_mailbox
    waits.ret = waits.safe = waits.tx_mailbox = _ANSWER_US
    try:
        yield
    finally:
        waits.ret, waits.safe, waits.tx_mailbox = usual


def close_master(master: Any) -> None:
    """Ask for INIT, then close; a dead segment does not matter any more."""
    with contextlib.suppress(Exception):  # pysoem raises bare exceptions of several kinds here
        master.state = pysoem.INIT_STATE
        master.write_state()
    with contextlib.suppress(Exception):
        master.close()


def scan(master: Any) -> list[SlaveInfo]:
    """All slaves of the segment, in their order. Raises SegmentError when none answers."""
    if master.config_init() <= 0:
        raise SegmentError("no EtherCAT slave answers; check cable, power and the interface")
    return [
        SlaveInfo(position, slave.man, slave.id, slave.rev, slave.name)
        for position, slave in enumerate(master.slaves, start=1)
    ]


def enter_preop(master: Any) -> None:
    """Take the slaves to PRE-OP, where their mailboxes answer. Raises SegmentError."""
    master.state = pysoem.PREOP_STATE
    master.write_state()
    if master.state_check(pysoem.PREOP_STATE, _STATE_US) != pysoem.PREOP_STATE:
        raise SegmentError("the segment does not reach PRE-OP; power it off and on")


def assignments(master: Any) -> dict[int, list[str]]:
    """The PDOs assigned to the inputs of each EL3783 by position, a line each. Raises SegmentError."""
    enter_preop(master)
    lines: dict[int, list[str]] = {}
    for position, slave in enumerate(master.slaves, start=1):
        if (slave.man, slave.id) == (objects.BECKHOFF, objects.EL3783):
            with sdo_errors():
                lines[position] = [
                    f"{pdo:#06x}: {sum(entry & 0xFF for entry in entries)} bits in {len(entries)} entries"
                    for pdo in read_list(slave, objects.TXPDO_ASSIGN)
                    for entries in [read_list(slave, pdo)]
                ]
    return lines


def read_list(terminal: Any, index: int) -> list[int]:
    """Entries of an object whose subindex 0 counts them."""
    count = int.from_bytes(terminal.sdo_read(index, 0), "little")
    return [int.from_bytes(terminal.sdo_read(index, number), "little") for number in range(1, count + 1)]


@contextlib.contextmanager
def sdo_errors() -> Iterator[None]:
    """pysoem's errors of the mailbox as SegmentError."""
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
