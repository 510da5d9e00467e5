"""What is in an archive, and what is missing in it: segments in order, and every gap with its reason."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from acqd.archive.head import FOLLOWS, STARTED
from acqd.archive.segment import Segment
from acqd.archive.segment_file import FULL, STOPPED, SUFFIX, TORN, number_of, stamp_of
from acqd.errors import InputError, UserError, no_folder

_SOURCE, _DAMAGE = "the source sent none", "damaged bytes in the file"
_MARGIN_NS = 60 * 10**9
"""Of the stamps in names, which have seconds."""


@dataclass(frozen=True, slots=True)
class Gap:
    """Samples that are in no segment."""

    device: str
    begin_ns: int
    """UTC of the end of the sample before it."""
    end_ns: int
    """UTC of the sample after it."""
    samples: int | None
    """How many; None between two starts of acqd, which number their samples anew."""
    why: str


@dataclass(frozen=True, slots=True)
class Contents:
    """Segments of one archive."""

    segments: tuple[Segment, ...]
    """By device and number."""
    unreadable: tuple[str, ...]
    """A line for every file that is none."""

    def of(self, device: str) -> list[Segment]:
        """Of one device, in order."""
        return [segment for segment in self.segments if segment.head.origin.device == device]

    @property
    def devices(self) -> list[str]:
        """Names."""
        return list(dict.fromkeys(segment.head.origin.device for segment in self.segments))

    def gaps(self) -> list[Gap]:
        """Everything that is missing between the first and the last sample of each device."""
        return [gap for device in self.devices for gap in _gaps(self.of(device))]


def contents(
    folder: Path, device: str | None = None, begin_ns: int | None = None, end_ns: int | None = None
) -> Contents:
    """The segments below `folder` (an archive, or the folder of a device in one) that touch begin .. end.

    Raises UserError where there are none.
    """
    if not folder.is_dir():
        raise UserError(
            f"{folder}: {no_folder(folder)}; expected the archive of a daemon, [archive] folder in acqd.toml"
        )
    paths = sorted({*folder.glob(f"*{SUFFIX}"), *folder.glob(f"*/*{SUFFIX}")})
    paths = [path for path in paths if number_of(path) is not None]
    if not paths:
        raise UserError(f"{folder}: holds no segments of an archive (device/NUMBER-TIME{SUFFIX})")
    segments, bad = [], []
    for path in _near(paths, begin_ns, end_ns):
        try:
            segment = Segment.open(path)
        except FileNotFoundError:
            continue  # the ring has just made room
        except (InputError, OSError) as error:
            bad.append(str(error) if isinstance(error, InputError) else f"{path}: {error.strerror}")
            continue
        if device in (None, segment.head.origin.device) and segment.touches(begin_ns, end_ns):
            segments.append(segment)
    segments.sort(key=lambda each: (each.head.origin.device, each.head.number))
    return Contents(tuple(segments), tuple(bad))


def _near(paths: Sequence[Path], begin_ns: int | None, end_ns: int | None) -> Iterable[Path]:
    """Those whose names do not exclude the time: a segment ends before the next one begins.

    Unless the clock was set back, which shows in the names: then all of them.
    """
    folders: dict[Path, list[tuple[int, Path]]] = {}
    for path in paths:
        folders.setdefault(path.parent, []).append((stamp_of(path), path))
    for named in folders.values():
        stamps = [stamp for stamp, _ in named]
        if stamps != sorted(stamps):
            yield from (path for _, path in named)
            continue
        for (stamp, path), following in zip(named, [*stamps[1:], None], strict=True):
            early = begin_ns is not None and following is not None and following < begin_ns - _MARGIN_NS
            late = end_ns is not None and stamp > end_ns + _MARGIN_NS
            if not early and not late:
                yield path


def _gaps(segments: Sequence[Segment]) -> Iterator[Gap]:
    """Of one device."""
    before: Segment | None = None
    for segment in segments:
        if before is not None:
            yield from _between(before, segment)
        yield from _within(segment)
        before = segment


def _within(segment: Segment) -> Iterator[Gap]:
    """Samples that the source has lost, or damage."""
    device = segment.head.origin.device
    end, end_ns = segment.head.index, segment.head.utc_ns
    for k, place in enumerate(segment.chunks):
        if place.first > end:
            why = _DAMAGE if segment.harmed_before(k) else _SOURCE
            yield Gap(device, end_ns, place.utc_ns, place.first - end, why)
        end, end_ns = place.first + place.samples, place.end_ns


def _between(before: Segment, segment: Segment) -> Iterator[Gap]:
    device, head = segment.head.origin.device, segment.head
    same = head.after != 0  # one stream
    missing = head.index - before.end if same else None
    if same and not missing:
        return
    yield Gap(device, before.end_ns, head.utc_ns, missing, _why(before, segment))


def _why(before: Segment, segment: Segment) -> str:
    if segment.head.begins not in (STARTED, FOLLOWS):
        return segment.head.begins
    if segment.head.after not in (0, before.head.number):
        return "the segments between are gone"
    unended = before.why in (None, TORN)
    if segment.head.begins == FOLLOWS and unended:
        return _DAMAGE if before.damaged else "the disk took no more of the segment before"
    if segment.head.begins == FOLLOWS:
        return _SOURCE if before.why == FULL else str(before.why)
    if unended:
        return "acqd ended without a word: killed, crashed, or without power"
    return "acqd was stopped" if before.why == STOPPED else str(before.why)
