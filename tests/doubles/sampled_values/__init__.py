"""A merging unit: publishes IEC 61850-9-2LE / IEC 61869-9 sampled values on an interface, from its own encoder.

Lockstep: `--clock burst` and the command {"burst": n}. A packet socket with the default buffer of Linux (212992 octets)
held 256 unread frames of one or two ASDUs, 167 of six and 93 of eight (measured on a veth pair); the rest of a
longer burst is lost at the receiver. `SAFE_BURST` is below all of them.

VLAN: Linux takes the tag out of the octets before a packet socket sees the frame. A socket bound to EtherType 0x88BA
then gets it with the packet type PACKET_OTHERHOST, not PACKET_MULTICAST, where no VLAN interface exists.
"""

from __future__ import annotations

from tests.doubles.sampled_values.control import MergingUnitProcess
from tests.doubles.sampled_values.recording import RecordedWave
from tests.doubles.sampled_values.replay import Replay
from tests.doubles.sampled_values.stream import SvStream
from tests.doubles.sampled_values.unit import MergingUnit
from tests.doubles.sampled_values.wave import SvWave

SAFE_BURST = 80
"""Frames of all streams together that fit into a receiver's default socket buffer."""

__all__ = ["SAFE_BURST", "MergingUnit", "MergingUnitProcess", "RecordedWave", "Replay", "SvStream", "SvWave"]
