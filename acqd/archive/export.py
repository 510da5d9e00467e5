"""Archived samples as files of other programs: one file for every stretch without a gap."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import soundfile

from acqd.archive.catalogue import Contents
from acqd.atomic import write_complete
from acqd.errors import UserError
from acqd.metering.block import SampleBlock, StreamFormat
from acqd.sources.comtrade.write import write_comtrade
from acqd.sources.npz_write import npz_bytes
from acqd.sources.waveform import MOST_BYTES, Waveform
from acqd.timestamps import rfc3339

_COLUMNS = ("U1 [V]", "I1 [A]", "U2 [V]", "I2 [A]", "U3 [V]", "I3 [A]")


def stretches(there: Contents, begin_ns: int | None, end_ns: int | None) -> Iterator[Waveform]:
    """Unbroken stretches of samples in begin .. end, as the source delivered them: without corrections.

    A stretch ends where samples are missing, and where the clock was set. Raises InputError, UserError, OSError.
    """
    form: StreamFormat | None = None
    blocks: list[SampleBlock] = []
    for segment in there.segments:
        for block in segment.blocks(begin_ns, end_ns, skip=True):
            part = _within(block, segment.head.origin.form, begin_ns, end_ns)
            if part is None:
                continue
            follows = bool(blocks) and form == segment.head.origin.form and part.index == _end(blocks)
            if blocks and form is not None and not (follows and "clock_step" not in part.flags):
                yield _waveform(form, blocks)
                blocks = []
            form = segment.head.origin.form
            blocks.append(part)
            if sum(each.codes.nbytes for each in blocks[-1:]) * len(blocks) > MOST_BYTES:
                raise UserError("more than 4 GB of samples without a gap; choose a shorter time with --from and --to")
    if blocks and form is not None:
        yield _waveform(form, blocks)


def written(waveform: Waveform, path: Path, station: str) -> list[Path]:
    """The files of one stretch, by the ending of `path`. Raises UserError, OperationError."""
    kinds: dict[str, Callable[[], list[Path]]] = {
        ".npz": lambda: _complete(path, npz_bytes(waveform)),
        ".csv": lambda: _complete(path, _csv(waveform)),
        ".wav": lambda: _wav(waveform, path),
        ".cff": lambda: _comtrade(waveform, path, station),
        ".cfg": lambda: _comtrade(waveform, path, station),
    }
    if path.suffix.lower() not in kinds:
        raise UserError(f"{path}: expected a name that ends in {', '.join(kinds)}")
    return kinds[path.suffix.lower()]()


def _within(block: SampleBlock, form: StreamFormat, begin_ns: int | None, end_ns: int | None) -> SampleBlock | None:
    """The samples of a block whose times are in begin .. end."""
    count = len(block.codes)
    first = 0 if begin_ns is None else max(0, -(-(begin_ns - block.utc_ns) * form.rate // 1e9))
    last = count if end_ns is None else min(count, -(-(end_ns - block.utc_ns) * form.rate // 1e9))
    if first >= last:
        return None
    a, b = int(first), int(last)
    utc_ns = block.utc_ns + round(a * 1e9 / form.rate)
    return SampleBlock(block.codes[a:b], block.index + a, utc_ns, 0, block.flags)


def _end(blocks: list[SampleBlock]) -> int:
    return blocks[-1].index + len(blocks[-1].codes)


def _waveform(form: StreamFormat, blocks: list[SampleBlock]) -> Waveform:
    flags = frozenset[str]().union(*(block.flags for block in blocks))
    codes = np.concatenate([block.codes for block in blocks])
    return Waveform(rfc3339(blocks[0].utc_ns), codes, form, blocks[0].utc_ns, "simulated" in flags, flags=flags)


def _complete(path: Path, content: bytes) -> list[Path]:
    write_complete(path, content)
    return [path]


def _comtrade(waveform: Waveform, path: Path, station: str) -> list[Path]:
    write_comtrade(path, waveform, station)
    return [path] if path.suffix.lower() == ".cff" else [path, path.with_suffix(".dat")]


def _csv(waveform: Waveform) -> bytes:
    """Times and values, as `acqd replay` reads them."""
    form, start = waveform.form, waveform.start_utc_ns or 0
    values = waveform.codes * np.array(form.scale)
    lines = [",".join(("time", *_COLUMNS[: values.shape[1]]))]
    for k, row in enumerate(values.tolist()):
        stamp = rfc3339(start + round(k * 1e9 / form.rate), digits=9)
        lines.append(f"{stamp},{','.join(f'{value:.9g}' for value in row)}")
    return "\n".join([*lines, ""]).encode()


def _wav(waveform: Waveform, path: Path) -> list[Path]:
    """Codes of 16 bits, U1, I1, U2 ...; what a code means is not in a WAV file."""
    if waveform.form.bits != 16:
        raise UserError(f"{path}: WAV holds codes of 16 bits, and these have {waveform.form.bits}; choose .npz or .cff")
    with soundfile.SoundFile(path, "w", round(waveform.form.rate), waveform.codes.shape[1], "PCM_16") as file:
        file.write(waveform.codes)
    return [path]
