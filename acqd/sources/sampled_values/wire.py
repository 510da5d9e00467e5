"""The Ethernet side: frames of one EtherType from one interface, without waiting."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import socket
import struct
import time

import numpy as np
from numpy.typing import NDArray

from acqd.errors import UserError
from acqd.sources.interfaces import DROP_IN, check_interface
from acqd.sources.sampled_values.frame import ETHERTYPE

LONGEST = 1518
"""Bytes of the longest frame."""
_BUFFER = 16 << 20  # bytes the kernel keeps while MAIN_FAST is held up: seconds of the fastest stream
_SIOCGSTAMPNS = 0x8907
_SO_RCVBUFFORCE = 33
_PACKET_ADD_MEMBERSHIP, _PACKET_MR_PROMISC = 1, 1
_SOL_PACKET = 263


class PacketSocket:
    """Receives the sampled values that pass an interface."""

    def __init__(self, interface: str, batch: int = 512) -> None:
        """Raises UserError when the interface is not there or may not be listened on."""
        self.interface = interface
        check_interface(interface)
        try:
            # Protocol 0 until it is bound: otherwise frames of every interface would be collected meanwhile.
            self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
        except OSError as error:  # not permitted, or not among the unit's address families
            raise UserError(
                f"source.interface: this user may not listen on {interface} ({error.strerror}); give the service "
                f"CAP_NET_RAW ({DROP_IN}, or setcap cap_net_raw+ep on its Python)"
            ) from None
        self._socket.setblocking(False)
        for option in (_SO_RCVBUFFORCE, socket.SO_RCVBUF):  # beyond the host's limit where that is permitted
            with contextlib.suppress(PermissionError):
                self._socket.setsockopt(socket.SOL_SOCKET, option, _BUFFER)
                break
        self._socket.bind((interface, ETHERTYPE))
        number = socket.if_nametoindex(interface)
        # Publishers send to multicast addresses; promiscuous mode spares a list of them.
        membership = struct.pack("iHH8s", number, _PACKET_MR_PROMISC, 0, b"")
        self._socket.setsockopt(_SOL_PACKET, _PACKET_ADD_MEMBERSHIP, membership)
        self._rows: NDArray[np.uint8] = np.zeros((batch, LONGEST), dtype=np.uint8)
        self._views = [memoryview(row) for row in self._rows]
        self._lengths: NDArray[np.int64] = np.zeros(batch, dtype=np.int64)
        self._empty_ns = time.monotonic_ns()  # when nothing was waiting
        self.first_age_ns = 0
        """Time since the first frame of the last batch arrived [ns]."""

    def receive(self) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """Frames that are there: bytes [frames, LONGEST] and lengths. Raises OSError when the link is down."""
        count = 0
        receive = self._socket.recv_into
        try:
            while count < len(self._views):
                self._lengths[count] = receive(self._views[count])
                if not count:
                    self.first_age_ns = self._age_ns()
                count += 1
        except BlockingIOError:
            self._empty_ns = time.monotonic_ns()
        except OSError as error:
            if error.errno != errno.ENETDOWN or not count:
                raise
        return self._rows[:count], self._lengths[:count]

    def _age_ns(self) -> int:
        """Time since the kernel received the last frame [ns]; never longer than since nothing was waiting.

        The kernel's stamp is UTC: where that clock was set meanwhile, the monotonic one keeps the age sensible.
        """
        seconds, nanoseconds = struct.unpack("ll", fcntl.ioctl(self._socket, _SIOCGSTAMPNS, bytes(16)))
        age_ns = time.time_ns() - seconds * 1_000_000_000 - nanoseconds
        return int(min(max(0, age_ns), time.monotonic_ns() - self._empty_ns))

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()
