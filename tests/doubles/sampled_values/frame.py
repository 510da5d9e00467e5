"""Ethernet frame, SV header, savPdu and ASDU of IEC 61850-9-2."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from tests.doubles.sampled_values import ber

ETHERTYPE = 0x88BA
VLAN_ETHERTYPE = 0x8100
SIMULATE = 0x8000
"""Bit S of reserved1 (IEC 61850-9-2 Ed. 2): the frame is from a test set, not from the device."""
VLAN_PRIORITY = 4
"""Default priority of sampled values (IEC 61850-9-2)."""
MAX_FRAME = 1514
"""Octets of an Ethernet frame without tag and frame check sequence."""


@dataclass(frozen=True)
class Link:
    """Addresses of the frames. `vlan` is the VLAN identifier 0..4095, None for frames without tag."""

    destination: bytes
    source: bytes
    vlan: int | None = None
    priority: int = VLAN_PRIORITY

    def header(self) -> bytes:
        """Everything up to the EtherType of the sampled values."""
        tag = b"" if self.vlan is None else struct.pack(">HH", VLAN_ETHERTYPE, self.priority << 13 | self.vlan)
        return self.destination + self.source + tag + struct.pack(">H", ETHERTYPE)


def sv_frame(link: Link, appid: int, pdu: bytes, simulate: bool = False) -> bytes:
    """The whole frame around the savPdu. The length field counts from APPID on (IEC 61850-9-2)."""
    reserved1 = SIMULATE if simulate else 0
    return link.header() + struct.pack(">HHHH", appid, 8 + len(pdu), reserved1, 0) + pdu


def sav_pdu(asdus: list[bytes], octets: int = 0) -> bytes:
    """savPdu with noASDU and seqASDU; `octets` of each length field as in `ber.length`."""
    count = ber.element(0x80, ber.integer(len(asdus)), octets)
    return ber.element(0x60, count + ber.element(0xA2, b"".join(asdus), octets), octets)


@dataclass(frozen=True)
class Asdu:
    """Fields of one ASDU; None leaves an optional field out. `refr_tm` has the eight octets of `utc_time`."""

    sv_id: str
    smp_cnt: int
    conf_rev: int
    smp_synch: int
    sample: bytes
    dat_set: str | None = None
    refr_tm: bytes | None = None
    smp_rate: int | None = None
    smp_mod: int | None = None

    def encode(self, octets: int = 0) -> bytes:
        """The ASDU; counters have a fixed size, other than BER's INTEGER (IEC 61850-9-2)."""
        fields: list[tuple[int, bytes | None]] = [
            (0x80, self.sv_id.encode("ascii")),
            (0x81, None if self.dat_set is None else self.dat_set.encode("ascii")),
            (0x82, struct.pack(">H", self.smp_cnt)),
            (0x83, struct.pack(">I", self.conf_rev)),
            (0x84, self.refr_tm),
            (0x85, bytes([self.smp_synch])),
            (0x86, None if self.smp_rate is None else struct.pack(">H", self.smp_rate)),
            (0x87, self.sample),
            (0x88, None if self.smp_mod is None else struct.pack(">H", self.smp_mod)),
        ]
        present = [ber.element(tag, contents, octets) for tag, contents in fields if contents is not None]
        return ber.element(0x30, b"".join(present), octets)


def utc_time(seconds: int, part: float) -> bytes:
    """UtcTime of IEC 61850-8-1: seconds since 1970, `part` of a second in 24 bits, quality octet.

    The quality octet 0x0A says: 10 bits of the fraction are accurate (about 1 ms), the clock is synchronised.
    """
    return struct.pack(">II", seconds, int(part * (1 << 24)) << 8 | 0x0A)
