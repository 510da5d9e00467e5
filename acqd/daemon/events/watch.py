"""Watches the samples of a stream for voltage events: messages for the broker, waveforms for the disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from acqd.daemon.events.files import WaveformFiles
from acqd.daemon.events.recorder import Recorder
from acqd.daemon.events.section import EventsSection, Watched
from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.quality.event import Event
from acqd.telemetry.event import PowerEvent, message_of

Announce = Callable[[PowerEvent], None]
Where = Callable[[int], tuple[str, int] | None]
"""File of the archive and number in it of the sample with this number in the stream; None: it is not kept."""


class EventWatch:
    """Is fed the blocks that the meter is fed."""

    def __init__(
        self,
        section: EventsSection,
        form: StreamFormat,
        device: str,
        boot: str,
        announce: Announce,
        state_dir: Path | None,
        where: Where = lambda _: None,
    ) -> None:
        """Without `state_dir` no waveforms are kept. `where`: the place of a sample in the archive."""
        self._where = where
        self._device, self._boot, self._announce = device, boot, announce
        self._watched = Watched(section, form)
        self._waveforms: dict[int, str | None] = {}  # of the events in progress
        self._files: WaveformFiles | None = None
        self._recorder: Recorder | None = None
        if state_dir is not None and section.waveforms:
            folder = state_dir / f"events-{device}"
            self._files = WaveformFiles(folder, section.keep_files, section.keep_mb * 2**20)
            self._recorder = Recorder(form, section.pre_s, section.post_s, self._files.save)

    def feed(self, block: SampleBlock) -> None:
        """The next samples."""
        if self._recorder is not None:
            self._recorder.add(block)
        for event in self._watched.feed(block):
            self._report(event)

    def finish(self) -> None:
        """No more samples: report events in progress as unfinished, and write the last waveform."""
        for event in self._watched.finish():
            self._report(event)
        if self._recorder is not None:
            self._recorder.finish()
        if self._files is not None:
            self._files.close()

    def _report(self, event: Event) -> None:
        name = self._waveforms.pop(event.number, None)
        if self._recorder is not None:
            if name is None:
                name = self._recorder.begin(event)
            if event.end is not None:
                self._recorder.end(event)
        if event.end is None:
            self._waveforms[event.number] = name
        place = self._where(int(event.begin))
        archive = f"{place[0]}#{place[1]}" if place is not None else None
        sliding = self._watched.sliding
        self._announce(message_of(event, self._device, self._boot, sliding=sliding, waveform=name, archive=archive))
