"""One Ethernet frame of sampled values: where its parts are (IEC 61850-9-2, BER of ISO/IEC 8825-1)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

ETHERTYPE = 0x88BA
_HEADER = 14  # Ethernet addresses and type; the kernel has removed a VLAN tag
_APDU = _HEADER + 8  # after APPID, length and two reserved words
_SAV_PDU, _NO_ASDU, _SEQ_ASDU, _ASDU = 0x60, 0x80, 0xA2, 0x30
_SVID, _SMP_CNT, _CONF_REV, _REFR_TM, _SMP_SYNCH, _SMP_RATE, _SAMPLES = 0x80, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87


class FrameError(ValueError):
    """Bytes that are no frame of sampled values; the message says where they stop making sense."""


@dataclass(frozen=True, slots=True)
class Asdu:
    """Byte positions, within the frame, of one application service data unit."""

    svid: str
    conf_rev: int
    smp_cnt: int
    """Position of the u16 sample counter."""
    smp_synch: int
    """Position of the synchronisation octet."""
    samples: int
    """Position of the first value."""
    values: int
    """INT32 values, each followed by 32 quality bits."""
    refr_tm: int | None
    smp_rate: int | None
    """Samples/s or per period as the publisher says; None where absent."""


@dataclass(frozen=True, slots=True)
class FrameLayout:
    """A parsed frame: the next frames of the stream have their fields at the same places."""

    length: int
    """Bytes from the addresses to the end of the APDU; padding and the trailer of a redundant network follow."""
    appid: int
    asdus: tuple[Asdu, ...]

    @property
    def svid(self) -> str:
        """Identifier of the stream."""
        return self.asdus[0].svid

    @property
    def identity(self) -> tuple[str, int, int, int, int]:
        """svID, APPID, confRev, ASDUs a frame and values an ASDU: what must not change while metering."""
        first = self.asdus[0]
        return first.svid, self.appid, first.conf_rev, len(self.asdus), first.values


def parse(frame: bytes) -> FrameLayout:
    """Locate the parts of a frame without VLAN tag. Raises FrameError."""
    if len(frame) < _APDU + 2 or int.from_bytes(frame[12:14], "big") != ETHERTYPE:
        raise FrameError(f"{len(frame)} bytes without the sampled values' EtherType")
    appid = int.from_bytes(frame[_HEADER : _HEADER + 2], "big")
    end = _HEADER + int.from_bytes(frame[_HEADER + 2 : _HEADER + 4], "big")
    if not _APDU < end <= len(frame):
        raise FrameError(f"the length field says {end - _HEADER} bytes, {len(frame) - _HEADER} arrived")
    [(tag, start, stop)] = list(_elements(frame, _APDU, end))[:1]
    if tag != _SAV_PDU:
        raise FrameError(f"tag {tag:#x} where the savPdu (0x60) is expected")
    asdus = tuple(
        _asdu(frame, first, last)
        for kind, begin, after in _elements(frame, start, stop)
        if kind == _SEQ_ASDU
        for inner, first, last in _elements(frame, begin, after)
        if inner == _ASDU
    )
    announced = [
        int.from_bytes(frame[begin:after], "big")
        for kind, begin, after in _elements(frame, start, stop)
        if kind == _NO_ASDU
    ]
    if not asdus or announced != [len(asdus)]:
        raise FrameError(f"the savPdu holds {len(asdus)} ASDUs, noASDU says {announced}")
    return FrameLayout(end, appid, asdus)


def _elements(frame: bytes, start: int, end: int) -> Iterator[tuple[int, int, int]]:
    """(tag, first content byte, byte after the content) of consecutive BER elements."""
    position = start
    while position < end:
        if position + 2 > end:
            raise FrameError(f"an element is cut off at byte {position}")
        tag, length = frame[position], frame[position + 1]
        position += 2
        if length & 0x80:
            octets = length & 0x7F
            length = int.from_bytes(frame[position : position + octets], "big")
            position += octets
        if position + length > end:
            raise FrameError(f"element {tag:#x} at byte {position} is longer than what contains it")
        yield tag, position, position + length
        position += length


def _asdu(frame: bytes, start: int, end: int) -> Asdu:
    parts = {tag: (first, last) for tag, first, last in _elements(frame, start, end)}
    for tag, name, size in (
        (_SVID, "svID", None),
        (_SMP_CNT, "smpCnt", 2),
        (_CONF_REV, "confRev", 4),
        (_SMP_SYNCH, "smpSynch", 1),
        (_SAMPLES, "sample", None),
    ):
        if tag not in parts:
            raise FrameError(f"an ASDU lacks {name}")
        if size is not None and parts[tag][1] - parts[tag][0] != size:
            raise FrameError(f"{name} has {parts[tag][1] - parts[tag][0]} bytes, expected {size}")
    first, last = parts[_SAMPLES]
    if last == first or (last - first) % 8:
        raise FrameError(f"the data set has {last - first} bytes, expected values and qualities of 8 bytes together")
    return Asdu(
        svid=frame[slice(*parts[_SVID])].decode("latin-1"),
        conf_rev=int.from_bytes(frame[slice(*parts[_CONF_REV])], "big"),
        smp_cnt=parts[_SMP_CNT][0],
        smp_synch=parts[_SMP_SYNCH][0],
        samples=first,
        values=(last - first) // 8,
        refr_tm=parts[_REFR_TM][0] if _REFR_TM in parts else None,
        smp_rate=int.from_bytes(frame[slice(*parts[_SMP_RATE])], "big") if _SMP_RATE in parts else None,
    )
