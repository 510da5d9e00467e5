"""The ring of a PLC as a source: read the head, fetch what is new, check the sequence."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np

from acqd.errors import UserError
from acqd.sources import el3783
from acqd.sources.ads.client import PlcClient
from acqd.sources.ads.ring import Head, Slots, read_slots
from acqd.sources.ads.settings import AdsSettings
from acqd.sources.device import Clock, stream_format
from acqd.sources.el3783 import AUTO_GAIN
from acqd.sources.remote_ring import DeviceError, RemoteRing

_RANGE_CHANGED = "the terminal has changed its current range: a stream has one scale; set a fixed range in the terminal"
_MOST_SLOTS = 200  # in one exchange: a long outage is fetched in portions


class AdsSource(RemoteRing[PlcClient]):
    """Reads a TwinCAT PLC."""

    patience_s = 10.0  # a new connection waits for the probe, two symbols and the head, a second each

    def __init__(self, settings: AdsSettings, clock: Clock = time.monotonic_ns) -> None:
        super().__init__(settings.poll_ms, clock)
        self._settings = settings
        self.title = f"PLC {settings.ams_net_id}"
        self._made: PlcClient | None = None  # the last one
        self._range = 0  # bits of the phases in the 1 A range

    def exchange(self) -> None:
        """As of every ring. Raises UserError when AdsLib hangs: only another process reaches the PLC again."""
        super().exchange()
        if self._made is not None and self._made.hangs:
            raise UserError(f"{self.title}: its connection ended in the middle of an answer; MAIN_FAST starts again")

    def _make_client(self) -> PlcClient:
        self._made = PlcClient(self._settings)
        return self._made

    def _learn(self, client: PlcClient) -> None:
        head, settings = client.head(), self._settings
        if not head.newest:
            raise DeviceError("its ring holds no slot yet; does the task run PRG_AcqdFast?")
        slots = read_slots(head, client.slots(head, head.newest, 1)[0], head.newest)
        if not len(slots.seq):
            raise DeviceError("its newest slot is not whole; try again, and check FB_AcqdRing")
        self._range = int(slots.fine_range[0]) & self._phases_mask(head)
        self._declare(stream_format(1e9 / head.sample_ns, self._scale(head, self._range), settings.f_nominal))
        self._head, self._slot_ns = head, head.frames * head.sample_ns
        self._check_poll(head.slots * self._slot_ns)

    def _phases_mask(self, head: Head) -> int:
        """Range bits of the phases in use."""
        return (1 << head.channels // 2) - 1

    def _scale(self, head: Head, fine_range: int) -> tuple[float, ...]:
        """V and A per digit; fScale of a current holds for the 5 A range, the 1 A range has a fifth of it."""
        ratios = (self._settings.vt_ratio, self._settings.ct_ratio)
        fine = [channel % 2 and fine_range >> channel // 2 & 1 for channel in range(head.channels)]
        return tuple(
            digit * ratios[channel % 2] / (AUTO_GAIN if fine[channel] else 1)
            for channel, digit in enumerate(head.scale)
        )

    def _fetch(self, client: PlcClient) -> None:
        begun = self._clock()
        head = client.head()
        now = self._timed(begun)
        if head.same_ring != self._head.same_ring or head.scale != self._head.scale:
            raise UserError("the ring has another shape or scale than at the start; restart acqd")
        self._note_boot(head.boot)
        if not head.newest or (self._next is not None and head.newest < self._next):
            return
        first = self._first_to_fetch(head.newest, head.slots)
        end = min(head.newest + 1, first + _MOST_SLOTS)
        delivered = 0
        for data in client.slots(head, first, end - first):
            slots = read_slots(head, data, first)
            self._take(slots, now - head.newest * self._slot_ns)
            first += len(data) // head.slot_bytes
            delivered = int(slots.seq[-1]) if len(slots.seq) else delivered
        # What is not whole is lost; only the newest slot may just have been in the making.
        self._next = head.newest if end == head.newest + 1 and delivered != head.newest else end

    def _why_silent(self, client: PlcClient) -> str:
        state = client.plc_state()
        what = "its ring stands still" if state == "RUN" else f"it is in {state}"
        return f"{what}; check the task that runs PRG_AcqdFast"

    def _take(self, slots: Slots, origin_ns: int) -> None:
        """Queue runs of consecutive slots with equal flags; slot k ends at `origin_ns` + k slot periods."""
        if not len(slots.seq):
            return
        status = np.bitwise_or.reduce(slots.status, axis=1).astype(np.int64)
        changed = (slots.fine_range & self._phases_mask(self._head)) != self._range
        flags = [
            el3783.status_flags(word) | ({"invalid"} if other else set())
            for word, other in zip(status.tolist(), changed.tolist(), strict=True)
        ]
        seq = slots.seq.tolist()
        breaks = [k for k in range(1, len(seq)) if seq[k] != seq[k - 1] + 1 or flags[k] != flags[k - 1]]
        for start, stop in pairwise([0, *breaks, len(seq)]):
            codes = slots.codes[start:stop].reshape(-1, self._head.channels)
            before = seq[start] - 1  # slots before this one
            self._deliver(codes, before * self._head.frames, origin_ns + before * self._slot_ns, flags[start])
        self._find(_RANGE_CHANGED if changed[-1] else "")
