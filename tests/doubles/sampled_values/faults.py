"""Faults between the encoder and the wire: lost, repeated, swapped and damaged frames."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field

from tests.doubles.sampled_values.frame import VLAN_ETHERTYPE

ROUNDING_S = 1e-9
"""Times of frames are equal within this [s]."""
_PAST = {"malformed": "malformed", "duplicate": "duplicated", "reorder": "reordered"}
_COUNTED = ("dropped", "duplicated", "malformed", "reordered")


@dataclass
class Faults:
    """Pending faults of one stream; each counter says how many of the next frames it concerns.

    A frame that a pause or `drop` removes takes part in no other fault. `reorder` holds a frame until the next one
    has left: the last frame of a burst stays held, and the end of the process loses it.
    """

    drop: int = 0
    duplicate: int = 0
    malformed: int = 0
    kind: str = "cut"
    reorder: int = 0
    paused_until_s: float = float("-inf")
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(_COUNTED, 0))
    _held: list[bytes] = field(default_factory=list)

    def frames(self, frame: bytes, due_s: float) -> list[bytes]:
        """What goes on the wire now in place of `frame`."""
        if due_s < self.paused_until_s - ROUNDING_S:
            return self._lost()
        if self._take("drop"):
            return self._lost()
        if self._take("malformed"):
            frame = KINDS[self.kind](frame)
        copies = [frame, frame] if self._take("duplicate") else [frame]
        return self._swapped(copies)

    def _lost(self) -> list[bytes]:
        self.counts["dropped"] += 1
        return []

    def _take(self, fault: str) -> bool:
        """True if `fault` concerns this frame; counts it."""
        pending: int = getattr(self, fault)
        if pending == 0:
            return False
        setattr(self, fault, pending - 1)
        if fault != "drop":
            self.counts[_PAST[fault]] += 1
        return True

    def _swapped(self, frames: list[bytes]) -> list[bytes]:
        """Holds the first frame of a pair and sends it after the second."""
        if self._held:
            frames, self._held = frames + self._held, []
            return frames
        if self._take("reorder"):
            self._held = frames
            return []
        return frames


def _cut(frame: bytes) -> bytes:
    """The first half of the frame; every length field still names the whole."""
    return frame[: len(frame) // 2]


def _claims_more(frame: bytes) -> bytes:
    """noASDU is larger by one than the number of ASDUs."""
    place = _pdu_at(frame)
    count = place + 2 + (frame[place + 1] & 0x7F if frame[place + 1] & 0x80 else 0)
    value = count + 2 + (frame[count + 1] & 0x7F if frame[count + 1] & 0x80 else 0)
    return frame[:value] + bytes([frame[value] + 1 & 0x7F]) + frame[value + 1 :]


def _overlong(frame: bytes) -> bytes:
    """The length field of the SV header names 100 octets more than the frame has."""
    place = _pdu_at(frame) - 6
    (length,) = struct.unpack_from(">H", frame, place)
    return frame[:place] + struct.pack(">H", length + 100) + frame[place + 2 :]


def _other_pdu(frame: bytes) -> bytes:
    """The tag of the savPdu is [APPLICATION 1], which IEC 61850-9-2 does not define."""
    place = _pdu_at(frame)
    return frame[:place] + b"\x61" + frame[place + 1 :]


def _pdu_at(frame: bytes) -> int:
    """Place of the savPdu in an SV frame with or without VLAN tag."""
    (ethertype,) = struct.unpack_from(">H", frame, 12)
    return 26 if ethertype == VLAN_ETHERTYPE else 22


KINDS: dict[str, Callable[[bytes], bytes]] = {
    "cut": _cut,
    "count": _claims_more,
    "length": _overlong,
    "tag": _other_pdu,
}
"""Ways to damage a frame."""
