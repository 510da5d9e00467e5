"""A merging unit's stream as a source: frames in, blocks out, every hole in smpCnt a gap."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from acqd.errors import UserError
from acqd.retry import Backoff
from acqd.sources.device import Clock, DeviceSource, stream_format
from acqd.sources.sampled_values.counter import RateCheck, SecondCounter
from acqd.sources.sampled_values.decode import Decoder, Samples, names
from acqd.sources.sampled_values.frame import FrameError, parse
from acqd.sources.sampled_values.settings import SampledValuesSettings
from acqd.sources.sampled_values.survey import find_stream
from acqd.sources.sampled_values.wire import PacketSocket

_SILENCE_NS = 500_000_000


class SampledValuesSource(DeviceSource):
    """Subscribes to one stream of sampled values."""

    period_ns = 10_000_000

    def __init__(self, settings: SampledValuesSettings, clock: Clock = time.monotonic_ns) -> None:
        super().__init__(clock)
        self._settings = settings
        self._wire: PacketSocket | None = None
        self._heard_ns = 0
        self._changed = ""  # why frames of our stream are no longer accepted
        self._backoff = Backoff()

    def connect(self) -> None:
        """Listen for the stream and learn its rate. Raises UserError."""
        settings = self._settings
        self._wire = PacketSocket(settings.interface)
        stream, rate = find_stream(self._wire, settings)
        self._identity = stream.layout.identity
        self._decoder = Decoder(stream.layout, stream.template, settings.channels)
        self._declare(stream_format(rate, settings.scale, settings.f_nominal, bits=32))
        self._counter, self._rates = SecondCounter(round(rate)), RateCheck(round(rate))

    def open(self, utc_ns: int, index: int = 0) -> None:
        """Start with the next frame; what was heard before is forgotten."""
        assert self._wire is not None
        while len(self._wire.receive()[0]):
            pass
        super().open(utc_ns, index)
        self._heard_ns = self._clock()

    def exchange(self) -> None:
        """Take the frames that have arrived."""
        now = self._clock()
        if self._wire is None:
            self._open_again(now)
            return
        try:
            rows, lengths = self._wire.receive()
        except OSError as error:
            self._give_up(f"{self._settings.interface}: {error.strerror}; check cable and interface")
            return
        frames = self._ours(rows, lengths)
        if len(frames):
            self._take_all(self._decoder.decode(frames), now - self._wire.first_age_ns, self._wire.first_age_ns)
            self._heard_ns = now
            if not self._changed:
                self._find()
                self._backoff.reset()
                return
        if self._changed or now - self._heard_ns > _SILENCE_NS:
            name, interface = self._identity[0], self._settings.interface
            self._give_up(
                self._changed or f"no frames of {name!r} on {interface} for 0.5 s; check merging unit and network"
            )

    def close(self) -> None:
        """Stop listening to the interface."""
        if self._wire is not None:
            self._wire.close()
            self._wire = None

    def _give_up(self, reason: str) -> None:
        """Close the socket as well: one of a card that has gone hears nothing when the card is back."""
        self.close()
        self._lose(reason)

    def _open_again(self, now: int) -> None:
        if not self._backoff.due(now):
            return
        try:
            self._wire = PacketSocket(self._settings.interface)
        except UserError as error:
            self._lose(str(error))
            return
        self._heard_ns, self._changed = now, ""
        self._rates = RateCheck(round(self.form.rate))

    def _ours(self, rows: NDArray[np.uint8], lengths: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Frames of our stream; foreign and damaged ones are left out, a changed make-up is noticed."""
        length = self._decoder.layout.length
        frames = rows[_whole(rows, lengths, length), :length]
        matching = self._decoder.matching(frames)
        if matching.all() and len(frames) == len(rows):
            return frames
        # Only what carries our APPID is worth a look: foreign streams may be many.
        ours = (rows[:, 14:16] == self._decoder.appid).all(axis=1)
        if ours.sum() > matching.sum():
            for row, size in zip(rows[ours], lengths[ours].tolist(), strict=True):
                self._check_change(bytes(row[:size]))
        return frames[matching]

    def _check_change(self, frame: bytes) -> None:
        """A frame that is not like the others: another layout of the same data, or another data set."""
        try:
            layout = parse(frame)
        except FrameError:
            return
        svid, appid, conf_rev, *_ = self._identity
        if layout.identity == self._identity:
            if layout != self._decoder.layout:  # an optional field has come or gone
                self._decoder = Decoder(layout, frame, self._settings.channels)
        elif (layout.svid, layout.appid) == (svid, appid):
            self._changed = (
                f"the stream {svid!r} has changed (confRev {layout.identity[2]}, was {conf_rev}): its data set may "
                "mean something else now; check source.channels and restart acqd"
            )

    def _take_all(self, samples: Samples, first_ns: int, span_ns: int) -> None:
        """Samples that arrived within `span_ns` from `first_ns` on; where smpCnt was set, a new part begins."""
        wrong = self._rates.contradiction(samples.counter)
        if wrong:
            self._changed = wrong
            return
        cuts = self._counter.settings_in(samples.counter, span_ns)
        starts = [0, *cuts]
        for start, stop in zip(starts, [*cuts, len(samples.counter)], strict=True):
            part = Samples(samples.counter[start:stop], samples.codes[start:stop], samples.flags[start:stop])
            self._take(part, first_ns + round(start * 1e9 / self.form.rate))

    def _take(self, samples: Samples, first_ns: int) -> None:
        """Queue the samples, cut where one is missing or the flags change; a late copy is dropped."""
        numbers = self._counter.unwrap(samples.counter, first_ns)
        if self._counter.was_set:
            self._numbering.restart()  # time places what follows: no sample is lost, none is invented
        numbers, order = np.unique(numbers, return_index=True)
        codes, flags = samples.codes[order], samples.flags[order]
        cuts = np.flatnonzero((np.diff(numbers) != 1) | (np.diff(flags) != 0)) + 1
        starts = [0, *cuts.tolist()]
        for start, stop in zip(starts, [*starts[1:], len(numbers)], strict=True):
            taken_ns = first_ns + round((numbers[start] - numbers[0]) * 1e9 / self.form.rate)
            named = names(int(flags[start])) | ({"sync_error"} if self._counter.was_set else set())
            self._place(codes[start:stop], int(numbers[start]), taken_ns, named)


def _whole(rows: NDArray[np.uint8], lengths: NDArray[np.int64], length: int) -> NDArray[np.bool_]:
    """Frames that end with the APDU, or with what Ethernet or a redundant network adds to it.

    Ethernet pads to 60 bytes. PRP (IEC 62439-3) adds six bytes, the last two of which are 0x88FB.
    """
    exact = lengths == length
    if exact.all():
        return np.asarray(exact)
    ends = np.arange(len(rows)), np.maximum(lengths, 2)
    trailer = (rows[ends[0], ends[1] - 2] == _PRP[0]) & (rows[ends[0], ends[1] - 1] == _PRP[1])
    longer = lengths > length
    return np.asarray(exact | (longer & (lengths <= _SHORTEST)) | (longer & trailer & (lengths <= _longest(length))))


def _longest(length: int) -> int:
    return max(length, _SHORTEST) + _TRAILER


_PRP, _TRAILER, _SHORTEST = (0x88, 0xFB), 6, 60
