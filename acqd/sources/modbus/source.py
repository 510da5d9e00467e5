"""A waveform bridge as a source: read how far it is, fetch the new blocks, check their numbers."""

from __future__ import annotations

import time

import numpy as np

from acqd.errors import UserError
from acqd.sources.device import Clock, stream_format
from acqd.sources.modbus.client import ModbusClient, Read
from acqd.sources.modbus.registers import (
    HEADER_REGISTERS,
    MOVING,
    MOVING_REGISTERS,
    Blocks,
    Layout,
    MapError,
    decode_blocks,
    parse_layout,
    parse_progress,
    status_flags,
)
from acqd.sources.modbus.settings import BridgeSettings
from acqd.sources.remote_ring import RemoteRing

_FUNCTION = 3
_MOST_REGISTERS = 125
_PATIENCE_S = 8.0  # the longest answer on a slow serial line
_ANSWERS = 6  # that one exchange may wait for in vain
_MOST_BLOCKS = 256  # in one exchange: a long outage is fetched in portions


class BridgeSource(RemoteRing[ModbusClient]):
    """Reads a waveform bridge over Modbus TCP or RTU."""

    def __init__(self, settings: BridgeSettings, clock: Clock = time.monotonic_ns) -> None:
        super().__init__(settings.poll_ms, clock)
        self._settings = settings
        self.title = f"waveform bridge {settings.link}"
        self.patience_s = _PATIENCE_S + _ANSWERS * settings.link.timeout_s

    def _make_client(self) -> ModbusClient:
        return ModbusClient(self._settings.link, self._settings.connections)

    def _learn(self, client: ModbusClient) -> None:
        layout, settings = self._read_layout(client), self._settings
        ratios = (settings.vt_ratio, settings.ct_ratio) * (layout.channels // 2)
        scale = tuple(digit * ratio for digit, ratio in zip(layout.scale, ratios, strict=True))
        self._declare(stream_format(layout.rate, scale, settings.f_nominal))
        self._layout = layout
        self._check_poll(layout.slots * layout.block_ns)

    def _recognise(self, client: ModbusClient) -> None:
        if self._read_layout(client) != self._layout:
            raise UserError("it has another register map or scale than at the start; restart acqd")

    def _read_layout(self, client: ModbusClient) -> Layout:
        settings = self._settings
        [data] = client.read(settings.unit, [(_FUNCTION, settings.address, HEADER_REGISTERS)])
        try:
            return parse_layout(data)
        except MapError as error:
            raise UserError(str(error)) from None

    def _fetch(self, client: ModbusClient) -> None:
        settings, layout = self._settings, self._layout
        begun = self._clock()
        [data] = client.read(settings.unit, [(_FUNCTION, settings.address + MOVING, MOVING_REGISTERS)])
        now = self._timed(begun)
        progress = parse_progress(data)
        self._note_boot(progress.boot)
        if progress.newest < 0:
            return
        newest = self._unwrapped(progress.newest)
        if self._next is not None and newest < self._next:
            return
        oldest = newest - (progress.newest - progress.oldest) % layout.wrap
        first = max(self._first_to_fetch(newest, layout.slots), oldest)
        end = min(newest + 1, first + _MOST_BLOCKS)
        data = b"".join(client.read(settings.unit, self._reads(first, end - first)))
        self._take(decode_blocks(layout, first, data), now - (newest - first + 1) * layout.block_ns)
        self._next = end

    def _unwrapped(self, newest: int) -> int:
        """The newest block's number without its wrap: the nearest to the block that is expected next."""
        if self._next is None:
            return newest
        half = self._layout.wrap // 2
        return self._next + (newest - self._next + half) % self._layout.wrap - half

    def _why_silent(self, client: ModbusClient) -> str:  # noqa: ARG002 - the registers say no more
        return "its ring stands still, or is written over before it is read; check its sampling clock and the network"

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
            self._deliver(
                np.ascontiguousarray(blocks.codes[run].reshape(-1, layout.channels)),
                int(blocks.counter[start]),
                taken_ns + start * layout.block_ns,
                status_flags(int(blocks.status[start])),
            )
        self._find()
