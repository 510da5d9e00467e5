"""WAV and FLAC recordings (sound-card loggers): channels in order U1, I1, U2, I2 ..."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, Literal

import numpy as np
import soundfile
from numpy.typing import NDArray

from acqd.errors import InputError
from acqd.sources.recording.channel import Channel, Column, Recording
from acqd.sources.waveform import MOST_BYTES, QUANTITIES, ChannelMap

_FULL_SCALE = 32768
_BEYOND = 2.0
"""Times full scale that a recording of floating-point numbers may reach."""
_LOOK = 8_192
"""Samples whose strongest line shows the order of the channels."""
_NEAR_deg = 10.0
_DEAD = 0.03  # of the largest line
_HEAD = 65_536  # bytes in which the chunk of the samples begins


def load(path: Path, given: ChannelMap) -> Recording:
    """`--u-scale` and `--i-scale` say how many V and A full scale is. Raises InputError."""
    if given.u_scale is None or given.i_scale is None:
        raise InputError(path, "sound files have no units: give V and A at full scale with --u-scale and --i-scale")
    notes: list[str] = []
    content: Path | io.BytesIO = path
    if path.suffix.lower() == ".wav":
        content = _whole(path, notes)
    try:
        with soundfile.SoundFile(content) as file:
            count, exact = file.channels, file.subtype == "PCM_16"
            rate, announced = float(file.samplerate), file.frames
            if announced * count * 8 > MOST_BYTES:
                raise InputError(path, f"announces {announced} samples of {count} channels; is its header damaged?")
            values = file.read(dtype="int16" if exact else "float64", always_2d=True)
    except (soundfile.LibsndfileError, RuntimeError, ValueError, MemoryError) as error:
        raise InputError(path, f"is no readable WAV or FLAC file ({error})") from None
    if not len(values):
        raise InputError(path, "has no samples")
    if len(values) < announced:
        raise InputError(path, f"is truncated: {len(values)} of {announced} samples")
    if count > 6 and given.columns is None:
        raise InputError(path, f"has {count} channels; say which are which with --map u1=0,i1=1 ...")
    if given.columns is None:
        _refuse_other_order(path, values)
    notes += [] if exact else _beyond_full_scale(values, given)
    names = [*QUANTITIES[:count], *(f"channel {k}" for k in range(6, count))] if given.columns is None else [""] * count
    channels = [Channel(name) for name in names]

    def column(k: int) -> Column:
        return Column(values[:, k], 1 / _FULL_SCALE if exact else 1.0)

    kind = f"{path.suffix[1:].upper()}, {'16 bits' if exact else 'wider than 16 bits'}"
    return Recording(path, kind, channels, len(values), column, rate, notes=notes, noun="channel")


def _beyond_full_scale(values: NDArray[Any], given: ChannelMap) -> list[str]:
    """What to ask where the samples of a file with floating-point numbers may be V and A."""
    largest = float(np.abs(values).max())
    if largest <= _BEYOND or given.u_scale == given.i_scale == 1.0:
        return []
    return [f"its samples reach {largest:.4g} times full scale: are they V and A? Then --u-scale 1 --i-scale 1"]


def _refuse_other_order(path: Path, values: NDArray[Any]) -> None:
    """Raises InputError where U1, U2, U3, I1, ... make a system of voltages, and U1, I1, U2, ... do not."""
    count = values.shape[1]
    if count not in (4, 6):
        return
    part = values[:_LOOK] * np.hanning(len(values[:_LOOK]))[:, None]
    lines = np.fft.rfft(part, axis=0)[1:]
    line = lines[int(np.argmax(np.abs(lines).sum(axis=1)))] if len(lines) else np.zeros(count, dtype=np.complex128)
    pairs = line[0::2]
    if np.abs(pairs).min() < _DEAD * np.abs(pairs).max():
        return  # the angle of a channel without a voltage means nothing
    if not _are_apart(pairs, (0, 120, 180)) and _are_apart(line[: count // 2], (120, 180)):
        keys = ",".join(f"{q}{k + 1}={k + (q == 'i') * count // 2}" for k in range(count // 2) for q in "ui")
        raise InputError(
            path,
            f"its channels are not U1, I1, U2, I2 ... (the angles of their waves are no three-phase or split-phase "
            f"voltages); as all voltages, then all currents: --map {keys}",
        )


def _are_apart(lines: NDArray[np.complex128], degrees: tuple[int, ...]) -> bool:
    """Whether neighbours lie apart by one of some angles; by 0 as well where two voltages are of one phase."""
    apart = np.abs(np.degrees(np.angle(lines[1:] * lines[:-1].conj())))
    return bool((np.abs(apart[:, None] - np.array(degrees)).min(axis=1) < _NEAR_deg).all())


def _whole(path: Path, notes: list[str]) -> Path | io.BytesIO:
    """The file, or its content with the lengths that a program on a pipe could not know.

    libsndfile reads a truncated WAV without an error; the length in its header shows that. Programs that write through
    a pipe (arecord, sox, ffmpeg) write 0 or nearly 2^31 or 2^32: those are no lengths. Raises InputError for a file
    that is shorter than a real length.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEAD)
    if head[:4] not in (b"RIFF", b"RIFX") or head[8:12] != b"WAVE":
        return path
    order: Literal["little", "big"] = "little" if head[:4] == b"RIFF" else "big"
    data = _data_chunk(head, order)
    if data is None or b"fmt " not in head:
        return path  # libsndfile says what is wrong with it
    begin, length = data
    if not _unknown(length):
        if size < begin + length:
            raise InputError(path, f"is truncated: {size} of {begin + length} bytes")
        return path
    block = int.from_bytes(head[head.index(b"fmt ") + 20 :][:2], order) or 1
    left = (size - begin) // block * block
    if left > MOST_BYTES:
        raise InputError(path, f"has {left} bytes; expected at most {MOST_BYTES}")
    notes.append("its header has no length (written through a pipe): read to the end of the file")
    mended = bytearray(path.read_bytes()[: begin + left])
    mended[4:8] = (begin + left - 8).to_bytes(4, order)
    mended[begin - 4 : begin] = left.to_bytes(4, order)
    return io.BytesIO(bytes(mended))


def _unknown(length: int) -> bool:
    """Lengths that stand for none: 0, and what is within 64 KiB of 2^31 and 2^32."""
    return length == 0 or length >= 2**32 - 65_536 or 2**31 - 65_536 <= length <= 2**31


def _data_chunk(head: bytes, order: Literal["little", "big"]) -> tuple[int, int] | None:
    """Position and announced length of the samples."""
    at = 12
    while at + 8 <= len(head):
        length = int.from_bytes(head[at + 4 : at + 8], order)
        if head[at : at + 4] == b"data":
            return at + 8, length
        at += 8 + length + length % 2
    return None
