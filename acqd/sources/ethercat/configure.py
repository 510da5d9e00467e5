"""From found slaves to terminals whose process image is laid out: identity, range, PDO assignment, mapping."""

from __future__ import annotations

from typing import Any

import pysoem

from acqd.errors import UserError
from acqd.sources.ethercat import objects
from acqd.sources.ethercat.bus import SegmentError, enter_preop, read_list, scan, sdo_errors
from acqd.sources.ethercat.layout import BlockLayout, build_layout
from acqd.sources.ethercat.settings import OVERSAMPLING, RANGE_CODE, EthercatSettings


def find_terminals(master: Any, settings: EthercatSettings) -> list[Any]:
    """The EL3783 of the segment, in their order.

    Raises UserError when there are more or fewer than configured, SegmentError when a slave that may be one is unknown.
    """
    slaves = scan(master)
    found = [
        slave
        for slave, info in zip(master.slaves, slaves, strict=True)
        if (info.vendor, info.product) == (objects.BECKHOFF, objects.EL3783)
    ]
    unknown = [info.position for info in slaves if not info.vendor]
    if unknown and len(found) < settings.terminals:  # what a lost frame leaves: SOEM reads zeros, and reports no error
        raise SegmentError(f"slave {unknown[0]} does not say what it is; check cable and power, then its EEPROM")
    if len(found) != settings.terminals:
        there = ", ".join(f"{info.position}: {info.title}" for info in slaves)
        line = f"expected {settings.terminals} EL3783 on {settings.interface}, found {len(found)} ({there})"
        if len(slaves) <= 1 + len(found) < 1 + settings.terminals:  # the others may get their power later
            raise SegmentError(f"{line}; check power, or source.terminals")
        raise UserError(f"source.terminals: {line}")
    return found


def configure(master: Any, terminals: list[Any], settings: EthercatSettings) -> list[BlockLayout]:
    """PRE-OP: range, PDO assignment, layout as read back, and the mapping of the process image."""
    samples_pdo = OVERSAMPLING.index(settings.samples())
    enter_preop(master)
    with sdo_errors():
        layouts = [_prepare(terminal, samples_pdo, settings) for terminal in terminals]
    try:
        master.config_map()
    except pysoem.ConfigMapError as error:
        raise SegmentError(f"the process image cannot be mapped ({error})") from None
    for terminal, layout in zip(terminals, layouts, strict=True):
        # After a lost SDO reply SOEM takes a wrong size and reports no error.
        if len(terminal.input) != layout.size:
            raise SegmentError(f"{terminal.name} maps {len(terminal.input)} bytes, its objects say {layout.size}")
    return layouts


def _prepare(terminal: Any, samples_pdo: int, settings: EthercatSettings) -> BlockLayout:
    if settings.range_object:
        _set_range(terminal, settings)
    wanted = objects.assignment(samples_pdo)
    terminal.sdo_write(objects.TXPDO_ASSIGN, 0, bytes([0]))
    for number, pdo in enumerate(wanted, start=1):
        try:
            terminal.sdo_write(objects.TXPDO_ASSIGN, number, pdo.to_bytes(2, "little"))
        except pysoem.SdoError:
            if pdo != objects.RANGE_PDO or settings.current_range == "auto":
                raise
            wanted.remove(pdo)  # the last one: this firmware does not report its range
    terminal.sdo_write(objects.TXPDO_ASSIGN, 0, bytes([len(wanted)]))
    assigned = read_list(terminal, objects.TXPDO_ASSIGN)
    if assigned != wanted:
        raise SegmentError(f"{terminal.name} did not keep its PDO assignment; power it off and on")
    try:
        return build_layout(assigned, lambda pdo: read_list(terminal, pdo))
    except UserError as error:  # also what a lost SDO reply leaves of a mapping: worth another try
        raise SegmentError(str(error)) from None


def _set_range(terminal: Any, settings: EthercatSettings) -> None:
    index, _, subindex = settings.range_object.partition(":")
    try:
        terminal.sdo_write(int(index, 16), int(subindex, 16), bytes([RANGE_CODE[settings.current_range]]))
    except pysoem.SdoError as error:
        raise UserError(
            f"source.range_object: {terminal.name} refuses object {settings.range_object} ({error.desc}); give the one "
            "of its manual, or set the range in TwinCAT and leave range_object empty"
        ) from None
