"""Listening before metering: which streams are on the wire, and at which rate."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from acqd.errors import UserError
from acqd.sources.sampled_values.elsewhere import listen
from acqd.sources.sampled_values.frame import FrameError, FrameLayout, parse
from acqd.sources.sampled_values.settings import SampledValuesSettings
from acqd.sources.sampled_values.wire import PacketSocket

_LISTEN_S = 1.5
_RATE_S = 10.0  # at most, for two equal wraps of smpCnt, which come once a second: frames may be lost at some
_PIECE_S = 0.2
_POLL_S = 0.005


@dataclass(slots=True)
class Stream:
    """One stream that was heard."""

    layout: FrameLayout
    template: bytes
    wrapped: list[int] = field(default_factory=list)
    """smpCnt before each wrap."""
    last: int | None = None

    @property
    def counted(self) -> bool:
        """Whether two wraps in a row were equal."""
        return len(self.wrapped) >= 2 and self.wrapped[-1] == self.wrapped[-2]

    def note(self, frame: bytes) -> None:
        """Follow smpCnt of one more frame."""
        for asdu in self.layout.asdus:
            count = int.from_bytes(frame[asdu.smp_cnt : asdu.smp_cnt + 2], "big")
            if self.last is not None and count < self.last // 2:
                self.wrapped.append(self.last)
            self.last = count


def find_stream(wire: PacketSocket, settings: SampledValuesSettings) -> tuple[Stream, float]:
    """The stream that the settings mean, and its rate [samples/s]. Raises UserError."""
    streams = _listen(wire, _LISTEN_S, {}, settings)
    stream = _chosen(streams, settings, wire.interface)
    rate = settings.rate or _announced(stream.layout)
    if rate is None:
        end = time.monotonic() + _RATE_S
        while not stream.counted and time.monotonic() < end:
            _listen(wire, _PIECE_S, streams)
        rate = _counted(stream)
    if max(settings.channels) >= stream.layout.asdus[0].values:
        raise UserError(
            f"source.channels: the data set of {stream.layout.svid!r} has {stream.layout.asdus[0].values} values, "
            f"position {max(settings.channels)} is not among them"
        )
    return stream, rate


def _listen(
    wire: PacketSocket,
    seconds: float,
    streams: dict[tuple[str, int], Stream],
    wanted: SampledValuesSettings | None = None,
) -> dict[tuple[str, int], Stream]:
    """Note the streams of some seconds, or until the one that svID and APPID name was heard."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if wanted is not None and (wanted.svid, wanted.appid) in streams:
            break
        try:
            rows, lengths = wire.receive()
        except OSError as error:
            raise UserError(
                f"source.interface: {wire.interface}: {error.strerror}; bring it up (ip link set {wire.interface} up)"
            ) from None
        for row, length in zip(rows, lengths.tolist(), strict=True):
            _note(streams, bytes(row[:length]))
        if not len(rows):
            time.sleep(_POLL_S)
    return streams


def _note(streams: dict[tuple[str, int], Stream], frame: bytes) -> None:
    try:
        layout = parse(frame)
    except FrameError:
        return
    key = (layout.svid, layout.appid)
    stream = streams.get(key)
    if stream is None or stream.layout.identity != layout.identity:
        stream = streams[key] = Stream(layout, frame)
    stream.note(frame)


def _chosen(streams: dict[tuple[str, int], Stream], settings: SampledValuesSettings, interface: str) -> Stream:
    heard = ", ".join(f"{svid!r} (APPID {appid:#06x})" for svid, appid in sorted(streams)) or "none"
    meant = [
        stream
        for (svid, appid), stream in streams.items()
        if settings.svid in (None, svid) and settings.appid in (None, appid)
    ]
    if len(meant) == 1:
        return meant[0]
    if not streams:
        raise UserError(f"source.interface: no sampled values on {interface} within {_LISTEN_S} s; {listen(interface)}")
    if not meant:
        raise UserError(f"source.svid: {settings.svid!r} is not among the streams on {interface}: {heard}")
    raise UserError(f"source.svid: {interface} carries several streams, name one of {heard}")


def _announced(layout: FrameLayout) -> float | None:
    """smpRate, where it is in samples/s (small numbers are samples per period: 80, 96, 256)."""
    rate = layout.asdus[0].smp_rate
    return float(rate) if rate is not None and rate >= 2_000 else None


def _counted(stream: Stream) -> float:
    """The rate at which smpCnt wraps; two equal wraps are asked for, since a frame may be lost at one."""
    if stream.counted:
        return float(stream.wrapped[-1] + 1)
    raise UserError(
        f"source.rate: the sampling rate of {stream.layout.svid!r} cannot be counted "
        f"(smpCnt wrapped after {stream.wrapped or 'no value'}); give source.rate"
    )
