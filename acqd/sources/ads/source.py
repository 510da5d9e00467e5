"""The ring of a PLC as a source: read the head, fetch what is new, mind the sequence."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np

from acqd.errors import UserError
from acqd.sources import el3783
from acqd.sources.ads.client import PlcClient, PlcError
from acqd.sources.ads.ring import Head, Slots, read_slots
from acqd.sources.ads.settings import AdsSettings
from acqd.sources.backoff import Backoff
from acqd.sources.device import Clock, DeviceSource, stream_format

_SILENCE_NS = 500_000_000
_MOST_SLOTS = 200  # in one read: a long outage is fetched in portions
_SAFE = 0.125  # share of the ring before the newest slot's successor that is about to be written over


class AdsSource(DeviceSource):
    """Reads a TwinCAT PLC."""

    def __init__(self, settings: AdsSettings, clock: Clock = time.monotonic_ns) -> None:
        super().__init__(clock)
        self._settings = settings
        self.period_ns = settings.poll_ms * 1_000_000
        self._client: PlcClient | None = None
        self._backoff = Backoff()
        self._next = 0  # sequence number to fetch next; 0: start with the newest
        self._advanced_ns = 0
        self._range: int | None = None

    def connect(self) -> None:
        """Find the ring. Raises UserError."""
        try:
            self._client = PlcClient(self._settings)
            self._head = self._client.head()
        except PlcError as error:
            raise UserError(f"PLC {self._settings.ams_net_id}: {error}") from None
        head, settings = self._head, self._settings
        ratios = (settings.vt_ratio, settings.ct_ratio) * (head.channels // 2)
        scale = tuple(digit * ratio for digit, ratio in zip(head.scale, ratios, strict=True))
        self._declare(stream_format(1e9 / head.sample_ns, scale, settings.f_nominal))
        self._slot_ns = head.frames * head.sample_ns
        longest_ns = head.slots * self._slot_ns // 4
        if self.period_ns > longest_ns:
            raise UserError(
                f"source.poll_ms: the PLC's ring holds {head.slots * self._slot_ns / 1e6:.0f} ms; "
                f"read it at least every {longest_ns / 1e6:.0f} ms"
            )

    def open(self, utc_ns: int, index: int = 0) -> None:
        """Start with the next slot."""
        super().open(utc_ns, index)
        self._advanced_ns = self._clock()

    def exchange(self) -> None:
        """Fetch the new slots, or try to connect again."""
        now = self._clock()
        try:
            if self._client is None:
                if not self._backoff.due(now):
                    return
                self._client = PlcClient(self._settings)
            self._fetch(self._client, now)
        except (PlcError, UserError) as error:
            self._disconnect(str(error))

    def close(self) -> None:
        """Drop the connection."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def _disconnect(self, reason: str) -> None:
        if self._client is not None:
            self._backoff.reset()
        self.close()
        self._lose(reason)

    def _fetch(self, client: PlcClient, now: int) -> None:
        head = client.head()
        if head.same_ring != self._head.same_ring or head.scale != self._head.scale:
            raise UserError("the PLC's ring has another shape or scale than at the start; restart acqd")
        if head.boot != self._head.boot:
            self._next = 0
            self._numbering.restart()
        self._head = head
        if head.newest < self._next or not head.newest:
            self._check_silence(client, now)
            return
        first = self._first_to_fetch(head)
        end = min(head.newest + 1, first + _MOST_SLOTS)
        delivered = 0
        for data in client.slots(head, first, end - first):
            slots = read_slots(head, data, first)
            self._take(slots, now - head.newest * self._slot_ns)
            first += len(data) // head.slot_bytes
            delivered = int(slots.seq[-1]) if len(slots.seq) else delivered
        # What is not whole is lost; only the newest slot may just have been in the making.
        self._next = head.newest if end == head.newest + 1 and delivered != head.newest else end
        if delivered:
            self._advanced_ns = now
            self._backoff.reset()

    def _first_to_fetch(self, head: Head) -> int:
        """Where the last fetch ended, or the oldest slot that is still safe."""
        if not self._next or head.newest - self._next > 2**32:
            return head.newest
        return max(self._next, head.newest - int(head.slots * (1 - _SAFE)))

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
        if now - self._advanced_ns < _SILENCE_NS:
            return
        state = client.plc_state()
        what = "the PLC's ring stands still" if state == "RUN" else f"the PLC is in {state}"
        self._lose(f"{what}; check the task that runs PRG_AcqdFast")
