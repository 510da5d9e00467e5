"""The samples of one stream on their way to the archive, cut into segments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from acqd.archive.head import FOLLOWS, STARTED, Head, Origin
from acqd.archive.segment_file import FULL, STOPPED
from acqd.metering.block import SampleBlock

if TYPE_CHECKING:
    from acqd.archive.recorder import Recorder

_BEHIND = "the disk was too slow"


@dataclass(slots=True)
class Sheet:
    """A segment as a track sees it: what has been handed over, not what is on disk."""

    head: Head
    name: str
    samples: int = 0
    failed: str = ""
    """Why it is on no disk, set by the thread."""


class Track:
    """Hands the samples of one stream over, in MAIN_SLOW; never waits and never fails."""

    def __init__(self, recorder: Recorder, origin: Origin, now: Callable[[], tuple[str, dict[str, Any]]]) -> None:
        self._recorder, self._origin, self._now = recorder, origin, now
        rate = origin.form.rate
        self._long, self._chunk = recorder.segment_s * rate, recorder.chunk_s * rate
        self._sheet: Sheet | None = None
        self._before: Sheet | None = None  # the segment before, for events that begin in it
        self._pending: list[SampleBlock] = []
        self._count = 0  # samples that are pending
        self._after = 0  # number of the segment before
        self._next = 0  # number after the last sample that is pending
        self._reason = STARTED  # of the next segment

    def take(self, blocks: Sequence[SampleBlock]) -> None:
        """Blocks that are about to be metered, before the first of them is: the state of the meter belongs to it."""
        sheet = self._sheet
        if sheet is not None and sheet.failed:
            self._drop(f"disk: {sheet.failed}")
        elif sheet is not None and sheet.samples >= self._long:
            self._hand_over()
            if self._sheet is not None:
                self._recorder.end(sheet, FULL)
                self._before, self._sheet, self._reason = sheet, None, FOLLOWS
        if self._sheet is None and not self._begin(blocks):
            return
        for block in blocks:
            if self._pending and block.index != self._next:  # no sample is missing within a chunk
                self._hand_over()
                if self._sheet is None:
                    return
            self._next = block.index + len(block.codes)
            self._pending.append(block)
            self._count += len(block.codes)
        if self._count >= self._chunk:
            self._hand_over()

    def finish(self) -> None:
        """No more samples."""
        self._hand_over()
        if self._sheet is not None:
            self._recorder.end(self._sheet, STOPPED)
            self._sheet = None

    def where(self, index: int) -> tuple[str, int] | None:
        """File and number of a sample in it, counted from the first of the file; None: it is in no file."""
        for sheet in (self._sheet, self._before):
            if sheet is not None and not sheet.failed and index >= sheet.head.index:
                return f"{self._origin.device}/{sheet.name}", index - sheet.head.index
        return None

    def _begin(self, blocks: Sequence[SampleBlock]) -> bool:
        recorder, first = self._recorder, blocks[0]
        if not recorder.ready:
            trouble = recorder.latest.trouble
            self._reason = _BEHIND if recorder.behind else f"disk: {trouble}" if trouble else self._reason
            recorder.lose(sum(len(block.codes) for block in blocks), _BEHIND if recorder.behind else "")
            return False
        boot, state = self._now()
        head = Head(recorder.next_number(), self._origin, boot, first.index, first.utc_ns, self._after, self._reason)
        self._sheet, self._after = recorder.begin(head, state), head.number
        return True

    def _hand_over(self) -> None:
        if self._sheet is None or not self._pending:
            return
        if not self._recorder.append(self._sheet, self._pending):
            self._drop(_BEHIND)
            return
        self._sheet.samples += self._count
        self._pending, self._count = [], 0

    def _drop(self, reason: str) -> None:
        """End a segment that cannot go on."""
        assert self._sheet is not None
        if not self._sheet.failed:
            self._recorder.end(self._sheet, reason)
        self._recorder.lose(self._count, reason if reason == _BEHIND else "")
        self._pending, self._count = [], 0
        self._sheet, self._reason = None, reason
