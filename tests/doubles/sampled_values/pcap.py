"""Captures in the classic pcap format (draft-ietf-opsawg-pcap), Ethernet frames only."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

_NANOSECONDS = 0xA1B23C4D
_MICROSECONDS = 0xA1B2C3D4
_ETHERNET = 1


def write_pcap(path: Path, frames: Iterable[tuple[float, bytes]]) -> None:
    """Writes pairs of time [s] and frame, with times in whole nanoseconds."""
    parts = [struct.pack("<IHHiIII", _NANOSECONDS, 2, 4, 0, 0, 65535, _ETHERNET)]
    for time_s, frame in frames:
        seconds, fraction = divmod(round(time_s * 1e9), 1_000_000_000)
        parts += [struct.pack("<IIII", seconds, fraction, len(frame), len(frame)), frame]
    path.write_bytes(b"".join(parts))


def read_pcap(path: Path) -> list[tuple[float, bytes]]:
    """Pairs of time since the first frame [s] and frame.

    Raises ValueError for another format (`editcap -F pcap` converts pcapng), another link type or a cut file.
    """
    data = path.read_bytes()
    order, per_second = _header(path, data)
    frames: list[tuple[float, bytes]] = []
    position, origin = 24, 0
    while position < len(data):
        if position + 16 > len(data):
            raise ValueError(f"{path} ends within a record header")
        seconds, fraction, size, _ = struct.unpack_from(order + "IIII", data, position)
        position += 16 + size
        if position > len(data):
            raise ValueError(f"{path} ends within a frame")
        ticks = seconds * per_second + fraction
        origin = origin if frames else ticks
        frames.append(((ticks - origin) / per_second, data[position - size : position]))
    return frames


def _header(path: Path, data: bytes) -> tuple[str, int]:
    """Byte order for `struct` and ticks per second."""
    for order in "<>":
        if len(data) < 24:
            break
        magic, _, _, _, _, _, link = struct.unpack_from(order + "IHHiIII", data)
        if magic in (_NANOSECONDS, _MICROSECONDS):
            if link & 0xFFFF != _ETHERNET:
                raise ValueError(f"{path} has the link type {link}, not Ethernet")
            return order, 1_000_000_000 if magic == _NANOSECONDS else 1_000_000
    raise ValueError(f"{path} is no classic pcap file; `editcap -F pcap` converts pcapng")
