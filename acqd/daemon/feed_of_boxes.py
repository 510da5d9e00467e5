"""Several sources in one daemon: rows of all of them, health of the worst one."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterable, Sequence
from dataclasses import asdict
from typing import Any

from acqd.daemon.box import Box
from acqd.daemon.health.snapshot import Cycles, FeedHealth, SourceLink, Windows
from acqd.errors import UserError
from acqd.plc.distribution import together
from acqd.plc.recent import SampledWindow
from acqd.sources.waveform import Waveform


async def _nothing() -> None:
    """The boxes hold nothing in common."""


class FeedOfBoxes:
    """A box that is away does not keep the others from metering."""

    def __init__(self, boxes: Sequence[Box], boot: str, end: Callable[[], Awaitable[None]] = _nothing) -> None:
        """`boot`: of the daemon; the rows of the boxes have boots of their own. `end` is called after the last box."""
        self._end = end
        self._boxes, self._boot = boxes, boot
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def refused(self) -> list[str]:
        """Real-time settings that this host does not permit, as sentences."""
        return list(dict.fromkeys(sentence for _, feed in self._running() for sentence in feed.refused))

    async def start(self) -> None:
        """Start every box. Raises UserError when none can be used, or the settings of one do not fit its source."""
        self._tasks = [asyncio.create_task(box.run()) for box in self._boxes]
        await asyncio.gather(*(box.tried.wait() for box in self._boxes))
        if wrong := [box for box in self._boxes if box.mistake]:
            await self.stop()
            raise UserError(f"source of {wrong[0].name}: {wrong[0].mistake}")
        if all(box.trouble for box in self._boxes):
            await self.stop()
            raise UserError(f"no source can be used; {self._boxes[0].name}: {self._boxes[0].trouble}")

    async def run(self) -> None:
        """Make rows until every source has ended or `stop` is called."""
        done, _ = await asyncio.wait(self._tasks, return_when=asyncio.FIRST_EXCEPTION)
        for task in done:
            if not task.cancelled():  # `stop` ends the wait for a device
                task.result()  # a bug ends the daemon

    async def stop(self) -> None:
        """End after the windows in progress."""
        for box, task in zip(self._boxes, self._tasks, strict=True):
            if box.feed is None:  # it waits for its device
                task.cancel()
        await asyncio.gather(*(box.stop() for box in self._boxes))
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._end()

    def close(self) -> None:
        """Every box has released what it held when its task ended."""

    def save(self) -> None:
        """Write the energy registers."""
        for _, feed in self._running():
            feed.save()

    def alive(self) -> bool:
        """Whether the rows of every box advance, or its source is away and is being tried."""
        return all(feed.alive() for _, feed in self._running())

    def health(self) -> FeedHealth:
        """Connected while all sources are; the oldest of the last rows; the cycles of all together; every box."""
        boxes = tuple(box.health() for box in self._boxes)
        running = [each for each in boxes if each.boot]
        ages = [each.last_row_age_s for each in running]
        source = SourceLink(
            all(each.source.connected for each in boxes),
            sum(each.source.reconnects + each.restarts for each in boxes),
            "; ".join(f"{each.name}: {each.source.trouble}" for each in boxes if each.source.trouble),
            sum(each.source.lost for each in boxes),
        )
        clocks = [each.synchronised for each in running if each.synchronised is not None]
        return FeedHealth(
            self._boot,
            source,
            None if None in ages or not ages else max(age for age in ages if age is not None),
            _together(each.cycles for each in running if each.cycles is not None),
            all(clocks) if clocks else None,
            sum((each.windows for each in boxes), Windows()),
            boxes,
            next((each.register_trouble for each in boxes if each.register_trouble), ""),
        )

    def window(self, device: str) -> tuple[str, SampledWindow | None] | None:
        """The newest window of a device of any box; None for its samples while its box is away."""
        for _, feed in self._running():
            found: tuple[str, SampledWindow | None] | None = feed.window(device)
            if found is not None:
                return found
        away = [name for box in self._boxes for name in box.config.devices if device in ("", name)]
        return (away[0], None) if away else None

    def capture(self, device: str, seconds: float) -> Waveform | None:
        """The newest samples of the box with this device; without a name, only where there is one box."""
        if not device and len(self._boxes) > 1:
            return None
        found = (feed.capture(device, seconds) for _, feed in self._running())
        return next((waveform for waveform in found if waveform is not None), None)

    def status(self) -> dict[str, Any]:
        """Of every box, by its device."""
        boxes: dict[str, Any] = {}
        for box in self._boxes:
            feed, now = box.feed, box.health()
            boxes[box.name] = {
                "source": now.kind, "trouble": box.trouble, "ended": now.ended, "restarts": now.restarts,
                "windows": asdict(now.windows),
            }  # fmt: skip
            if feed is not None:
                boxes[box.name] |= {"boot": now.boot} | feed.status()
        return {"simulated": any(box.get("simulated", False) for box in boxes.values()), "boxes": boxes}

    def _running(self) -> list[tuple[Box, Any]]:
        return [(box, box.feed) for box in self._boxes if box.feed is not None]


def _together(cycles: Iterable[Cycles]) -> Cycles | None:
    """Sums over the processes of MAIN_FAST."""
    every = list(cycles)
    if not every:
        return None
    names = ("cycles", "late", "missed", "exceeded", "restarts")
    sums = {name: sum(getattr(one, name) for one in every) for name in names}
    return Cycles(**sums, latency=together(one.latency for one in every), slow=together(one.slow for one in every))
