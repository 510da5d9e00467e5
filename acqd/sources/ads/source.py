"""The ring of a PLC as a source: read the head, fetch what is new, mind the sequence."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np

from acqd.errors import UserError
from acqd.sources import el3783
from acqd.sources.ads.client import PlcClient
from acqd.sources.ads.ring import Slots, read_slots
from acqd.sources.ads.settings import AdsSettings
from acqd.sources.device import Clock, stream_format
from acqd.sources.remote_ring import RemoteRing

_MOST_SLOTS = 200  # in one exchange: a long outage is fetched in portions


class AdsSource(RemoteRing[PlcClient]):
    """Reads a TwinCAT PLC."""

    def __init__(self, settings: AdsSettings, clock: Clock = time.monotonic_ns) -> None:
        super().__init__(settings.poll_ms, clock)
        self._settings = settings
        self.title = f"PLC {settings.ams_net_id}"
        self._range: int | None = None

    def _make_client(self) -> PlcClient:
        return PlcClient(self._settings)

    def _learn(self, client: PlcClient) -> None:
        head, settings = client.head(), self._settings
        ratios = (settings.vt_ratio, settings.ct_ratio) * (head.channels // 2)
        scale = tuple(digit * ratio for digit, ratio in zip(head.scale, ratios, strict=True))
        self._declare(stream_format(1e9 / head.sample_ns, scale, settings.f_nominal))
        self._head, self._slot_ns = head, head.frames * head.sample_ns
        self._check_poll(head.slots * self._slot_ns)

    def _fetch(self, client: PlcClient, now: int) -> None:
        head = client.head()
        if head.same_ring != self._head.same_ring or head.scale != self._head.scale:
            raise UserError("the ring has another shape or scale than at the start; restart acqd")
        self._note_boot(head.boot)
        if not head.newest or (self._next is not None and head.newest < self._next):
            self._check_silence(client, now)
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
        torn = end == head.newest + 1 and delivered != head.newest
        self._advance(head.newest if torn else end, now if delivered else self._advanced_ns)

    def _take(self, slots: Slots, origin_ns: int) -> None:
        """Queue runs of consecutive slots with equal flags; slot k ends at `origin_ns` + k slot periods."""
        if not len(slots.seq):
            return
        status = np.bitwise_or.reduce(slots.status, axis=1).astype(np.int64)
        flags = [el3783.status_flags(word) for word in status.tolist()]
        warning = self._check_range(int(slots.fine_range[-1]))
        if warning:
            flags = [named | {"invalid"} for named in flags]
        seq = slots.seq.tolist()
        breaks = [k for k in range(1, len(seq)) if seq[k] != seq[k - 1] + 1 or flags[k] != flags[k - 1]]
        for start, stop in pairwise([0, *breaks, len(seq)]):
            codes = slots.codes[start:stop].reshape(-1, self._head.channels)
            before = seq[start] - 1  # slots before this one
            self._place(codes, before * self._head.frames, origin_ns + before * self._slot_ns, flags[start])
        self._find(warning)

    def _check_range(self, fine_range: int) -> str:
        """The scale holds for the range of the first slot only."""
        if self._range is None:
            self._range = fine_range
        if fine_range == self._range:
            return ""
        return "the terminal has changed its current range: the PLC's fScale is wrong now; set a fixed range"

    def _check_silence(self, client: PlcClient, now: int) -> None:
        if self._silent(now):
            state = client.plc_state()
            what = "its ring stands still" if state == "RUN" else f"it is in {state}"
            self._lose(f"{self.title}: {what}; check the task that runs PRG_AcqdFast")
