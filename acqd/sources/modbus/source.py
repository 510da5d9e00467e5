"""A waveform bridge as a source: read how far it is, fetch the new blocks, mind their numbers."""

from __future__ import annotations

import time

import numpy as np

from acqd.errors import UserError
from acqd.sources.backoff import Backoff
from acqd.sources.device import Clock, DeviceSource, stream_format
from acqd.sources.modbus.client import ModbusClient, ModbusError, Read
from acqd.sources.modbus.registers import (
    HEADER_REGISTERS,
    MOVING,
    MOVING_REGISTERS,
    Blocks,
    Layout,
    MapError,
    Progress,
    decode_blocks,
    parse_layout,
    parse_progress,
    status_flags,
)
from acqd.sources.modbus.settings import BridgeSettings

_FUNCTION = 3
_MOST_REGISTERS = 125
_MOST_BLOCKS = 256  # in one exchange: a long outage is fetched in portions
_SAFE = 0.125  # share of the ring that the bridge may write over before our read arrives
_SILENCE_NS = 500_000_000


class BridgeSource(DeviceSource):
    """Reads a waveform bridge over Modbus TCP or RTU."""

    def __init__(self, settings: BridgeSettings, clock: Clock = time.monotonic_ns) -> None:
        super().__init__(clock)
        self._settings = settings
        self.period_ns = settings.poll_ms * 1_000_000
        self._client: ModbusClient | None = None
        self._backoff = Backoff()
        self._next: int | None = None  # block to fetch next; None: start with the newest
        self._boot: int | None = None
        self._advanced_ns = 0

    def connect(self) -> None:
        """Find the bridge. Raises UserError."""
        settings = self._settings
        self._client = ModbusClient(settings.link, settings.connections)
        try:
            self._layout = self._read_layout(self._client)
        except (ModbusError, MapError) as error:
            self.close()
            raise UserError(f"waveform bridge {settings.link}: {error}") from None
        layout = self._layout
        ratios = (settings.vt_ratio, settings.ct_ratio) * (layout.channels // 2)
        scale = tuple(digit * ratio for digit, ratio in zip(layout.scale, ratios, strict=True))
        self._declare(stream_format(layout.rate, scale, settings.f_nominal))
        if self.period_ns > layout.slots * layout.block_ns // 4:
            raise UserError(
                f"source.poll_ms: the bridge's ring holds {layout.slots * layout.block_ns / 1e6:.0f} ms; "
                f"read it at least every {layout.slots * layout.block_ns / 4e6:.0f} ms"
            )

    def open(self, utc_ns: int, index: int = 0) -> None:
        """Start with the newest block."""
        super().open(utc_ns, index)
        self._advanced_ns = self._clock()

    def exchange(self) -> None:
        """Fetch the new blocks, or try to connect again."""
        now = self._clock()
        try:
            if self._client is None:
                if not self._backoff.due(now):
                    return
                self._reconnect()
            assert self._client is not None
            self._fetch(self._client, now)
        except (ModbusError, MapError, UserError) as error:
            if self._client is not None and self._health.connected:
                self._backoff.reset()
            self.close()
            self._lose(f"waveform bridge {self._settings.link}: {error}")

    def close(self) -> None:
        """Drop the connections."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def _reconnect(self) -> None:
        self._client = ModbusClient(self._settings.link, self._settings.connections)
        layout = self._read_layout(self._client)
        if layout != self._layout:
            raise MapError("the bridge has another register map or scale than at the start; restart acqd")

    def _read_layout(self, client: ModbusClient) -> Layout:
        settings = self._settings
        [data] = client.read(settings.unit, [(_FUNCTION, settings.address, HEADER_REGISTERS)])
        return parse_layout(data)

    def _fetch(self, client: ModbusClient, now: int) -> None:
        settings, layout = self._settings, self._layout
        [data] = client.read(settings.unit, [(_FUNCTION, settings.address + MOVING, MOVING_REGISTERS)])
        progress = parse_progress(data)
        if self._boot not in (None, progress.boot):
            self._next = None
            self._numbering.restart()
        self._boot = progress.boot
        if progress.newest < 0 or (self._next is not None and progress.newest < self._next):
            if now - self._advanced_ns > _SILENCE_NS:
                self._lose(f"waveform bridge {settings.link}: its ring stands still; check its sampling clock")
            return
        first = self._first_to_fetch(progress)
        count = min(progress.newest - first + 1, _MOST_BLOCKS)
        blocks = decode_blocks(layout, first, b"".join(client.read(settings.unit, self._reads(first, count))))
        self._take(blocks, now - (progress.newest - first + 1) * layout.block_ns)
        self._next = first + count
        self._advanced_ns = now
        self._backoff.reset()

    def _first_to_fetch(self, progress: Progress) -> int:
        """Where the last fetch ended, or the oldest block that is still safe."""
        if self._next is None:
            return progress.newest
        safe = progress.newest - int(self._layout.slots * (1 - _SAFE))
        return max(self._next, safe, progress.oldest)

    def _reads(self, first: int, count: int) -> list[Read]:
        """One read a slot, or several neighbours in one where they fit."""
        layout = self._layout
        packed = layout.stride == layout.block_registers
        together = max(1, _MOST_REGISTERS // layout.stride) if packed else 1
        reads: list[Read] = []
        block, end = first, first + count
        while block < end:
            take = min(together, end - block, layout.slots - block % layout.slots)
            reads.append((_FUNCTION, layout.address(block), take * layout.block_registers))
            block += take
        return reads

    def _take(self, blocks: Blocks, taken_ns: int) -> None:
        """Queue runs of whole blocks with consecutive samples and equal flags; the rest is a gap."""
        layout = self._layout
        kept = np.flatnonzero(blocks.valid)
        if not len(kept):
            return
        jump = np.diff(blocks.counter[kept]) != layout.frames
        cuts = np.flatnonzero(jump | (np.diff(blocks.status[kept]) != 0)) + 1
        for run in np.split(kept, cuts):
            start = int(run[0])
            self._place(
                np.ascontiguousarray(blocks.codes[run].reshape(-1, layout.channels)),
                int(blocks.counter[start]),
                taken_ns + start * layout.block_ns,
                status_flags(int(blocks.status[start])),
            )
        self._find()
