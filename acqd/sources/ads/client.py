"""The way to the PLC: reachability first, then AMS, then the ring's two symbols."""

from __future__ import annotations

import contextlib
import ctypes
import socket
from typing import Any

import pyads

from acqd.errors import UserError
from acqd.sources.ads.limited import HangingError, LimitedCalls
from acqd.sources.ads.ring import HEAD_BYTES, Head, RingError, parse_head
from acqd.sources.ads.settings import AdsSettings
from acqd.sources.remote_ring import DeviceError

PORT = 48_898
"""TCP port of AMS; fixed."""
_PROBE_S = 1.5
_TIMEOUT_MS = 1_000
_LIMIT_S = 2.0  # of a call: AdsLib has given up by then, or never will
_ADVICE = {
    6: "no PLC runtime answers on source.ams_port; is the PLC in RUN?",
    7: "the AMS net id is not known there; check source.ams_net_id",
    1793: "the PLC does not offer this service; check source.ams_port",
    1808: "the PLC has no such symbol; add the function block of docs/twincat, or check source.namespace",
    1861: "no answer: the TwinCAT PC needs a route to this computer's AMS net id (docs/twincat)",
}


class PlcClient:
    """One connection. After an error it is closed and another one made: AdsLib's own threads do not always recover."""

    def __init__(self, settings: AdsSettings) -> None:
        """Connect and find the ring. Raises DeviceError, or UserError for a ring that is not ours."""
        self._settings = settings
        self._connection: Any = None
        self._call = LimitedCalls(_LIMIT_S)
        _probe(settings.host)
        try:
            if settings.local_net_id:
                pyads.open_port()
                pyads.set_local_address(settings.local_net_id)
            self._connection = pyads.Connection(settings.ams_net_id, settings.ams_port, settings.host)
            self._call(self._connection.open)
            self._call(self._connection.set_timeout, _TIMEOUT_MS)
            self._head = self._call(self._connection.get_symbol, f"{settings.namespace}.stHead")
            self._slots = self._call(self._connection.get_symbol, f"{settings.namespace}.aSlots")
        except (pyads.ADSError, RuntimeError, ValueError, HangingError) as error:
            self.close()
            raise _explained(error) from None

    def head(self) -> Head:
        """The head as it is now. Raises DeviceError, or UserError for a head that is not ours."""
        try:
            return parse_head(self._read(self._head.index_group, self._head.index_offset, HEAD_BYTES))
        except RingError as error:
            raise UserError(f"{self._settings.namespace}.stHead of {self._settings.host}: {error}") from None

    def slots(self, head: Head, first: int, count: int) -> list[bytes]:
        """The memory of `count` slots from sequence number `first` on; two pieces where the ring wraps."""
        index = first % head.slots
        until_end = min(count, head.slots - index)
        pieces = [self._slot_bytes(head, index, until_end)]
        if count > until_end:
            pieces.append(self._slot_bytes(head, 0, count - until_end))
        return pieces

    def plc_state(self) -> str:
        """RUN, STOP ... of the runtime. Raises DeviceError."""
        try:
            state = self._call(self._connection.read_state)[0]
        except (pyads.ADSError, HangingError) as error:
            raise _explained(error) from None
        return {pyads.ADSSTATE_RUN: "RUN", pyads.ADSSTATE_STOP: "STOP", pyads.ADSSTATE_CONFIG: "CONFIG"}.get(
            state, f"ADS state {state}"
        )

    def close(self) -> None:
        """Drop the connection."""
        if self._connection is None or self._call.lost:
            return
        with contextlib.suppress(pyads.ADSError, RuntimeError, HangingError):  # it is gone already
            self._call(self._connection.close)
        self._call.end()

    @property
    def hangs(self) -> bool:
        """Whether a call of AdsLib never returns: then its dead connection stays in this process, for every client."""
        return self._call.lost

    def _slot_bytes(self, head: Head, index: int, count: int) -> bytes:
        offset = self._slots.index_offset + index * head.slot_bytes
        return self._read(self._slots.index_group, offset, count * head.slot_bytes)

    def _read(self, group: int, offset: int, size: int) -> bytes:
        try:
            wanted = ctypes.c_ubyte * size
            return bytes(self._call(self._connection.read, group, offset, wanted, True))
        except (pyads.ADSError, RuntimeError, HangingError) as error:
            raise _explained(error) from None


def _probe(host: str) -> None:
    """AdsLib would wait for minutes for a computer that is off."""
    try:
        socket.create_connection((host, PORT), timeout=_PROBE_S).close()
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DeviceError(
            f"{host}:{PORT} does not answer ({reason}); is the TwinCAT PC on, and its firewall open?"
        ) from None


def _explained(error: Exception) -> DeviceError:
    if isinstance(error, HangingError):
        return DeviceError("its connection ended in the middle of an answer")
    code = getattr(error, "err_code", None)
    advice = _ADVICE.get(code) if isinstance(code, int) else None
    return DeviceError(f"ADS error {code}: {advice}" if advice else f"ADS: {error}")
