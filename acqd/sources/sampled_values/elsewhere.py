"""Where sampled values are that nobody hears: behind the tag of a ring, or of a second VLAN."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterable

from acqd.sources.sampled_values.frame import ETHERTYPE

_HSR, _VLANS, _GOOSE, _PTP = 0x892F, (0x8100, 0x88A8, 0x9100), 0x88B8, 0x88F7
_ETH_P_ALL = 3
_LISTEN_S = 0.3
_ADVICE = "check cable and merging unit"


def listen(interface: str) -> str:
    """What to do, from the frames of some tenths of a second."""
    frames: list[bytes] = []
    try:
        with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(_ETH_P_ALL)) as wire:
            wire.bind((interface, _ETH_P_ALL))
            end = time.monotonic() + _LISTEN_S
            while (left := end - time.monotonic()) > 0 and len(frames) < 2_000:
                wire.settimeout(left)
                frames.append(wire.recv(256))
    except OSError:  # silence, or an interface that has gone
        pass
    return advice(interface, frames)


def advice(interface: str, frames: Iterable[bytes]) -> str:
    """What to do about sampled values that do not arrive as such. `frames`: from the addresses on."""
    seen = {_types(frame) for frame in frames}
    if any(outer == _HSR and inner == ETHERTYPE for outer, inner in seen):
        return (
            f"{interface} is in an HSR ring (IEC 62439-3), whose tag precedes the values: connect acqd behind a "
            f"RedBox, or take the tag off with ip link add hsr0 type hsr slave1 {interface} slave2 ... version 1"
        )
    if any(outer in _VLANS and inner == ETHERTYPE for outer, inner in seen):
        return (
            f"they come with two VLAN tags: ip link add link {interface} name {interface}.ID type vlan id ID, and name "
            "that interface"
        )
    heard = [name for kind, name in ((_GOOSE, "GOOSE"), (_PTP, "PTP")) if any(outer == kind for outer, _ in seen)]
    return f"{' and '.join(heard)} arrive, so the cable is right: check the merging unit and VLAN" if heard else _ADVICE


def _types(frame: bytes) -> tuple[int, int]:
    """EtherType, and that behind a tag of HSR (six bytes) or VLAN (four bytes)."""
    outer = int.from_bytes(frame[12:14], "big")
    at = {_HSR: 18}.get(outer, 16)
    inner = int.from_bytes(frame[at : at + 2], "big")
    return outer, inner
