"""WAV and FLAC recordings (sound-card loggers): channels in order U1, I1, U2, I2 ..."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import soundfile

from acqd.errors import InputError
from acqd.sources.waveform import MOST_BYTES, ChannelMap, Waveform, physical, stream_format

_FULL_SCALE = 32768


def load(path: Path, channels: ChannelMap) -> Waveform:
    """`--u-scale` and `--i-scale` say how many V and A full scale is. Raises InputError."""
    u_scale, i_scale = channels.u_scale, channels.i_scale
    if u_scale is None or i_scale is None:
        raise InputError(path, "sound files have no units: give V and A at full scale with --u-scale and --i-scale")
    if path.suffix.lower() == ".wav":
        _check_whole(path)
    try:
        with soundfile.SoundFile(path) as file:
            count, exact = file.channels, file.subtype == "PCM_16"
            rate = channels.rate or float(file.samplerate)
            announced = file.frames
            if announced * count * 8 > MOST_BYTES:
                raise InputError(path, f"announces {announced} samples of {count} channels; is its header damaged?")
            values = file.read(dtype="int16" if exact else "float64", always_2d=True)
    except (soundfile.LibsndfileError, RuntimeError, ValueError, MemoryError) as error:
        raise InputError(path, f"is no readable WAV or FLAC file ({error})") from None
    if not len(values):
        raise InputError(path, "has no samples")
    if len(values) < announced:
        raise InputError(path, f"is truncated: {len(values)} of {announced} samples")
    names = {name: str(k) for k, name in enumerate(("u1", "i1", "u2", "i2", "u3", "i3")[:count])}
    if count > 6 and channels.columns is None:
        raise InputError(path, f"has {count} channels; say which are which with --map u1=0,i1=1 ...")
    pairs = channels.pairs(path, names)
    order = [_number(path, name, count) for pair in pairs for name in pair]
    f_nominal = channels.f_nominal or 50.0
    scale = [u_scale, i_scale] * len(pairs)
    if exact:
        codes = np.ascontiguousarray(values[:, order])
        form = stream_format(path, rate, [s / _FULL_SCALE for s in scale], f_nominal, codes)
        return Waveform(path.name, codes, form, None)
    return physical(path, np.ascontiguousarray(values[:, order]), scale, rate, f_nominal, None)


def _check_whole(path: Path) -> None:
    """libsndfile reads a truncated WAV without an error; the length in its header shows it."""
    with path.open("rb") as file:
        head = file.read(8)
    announced = int.from_bytes(head[4:8], "little") + 8
    if head[:4] == b"RIFF" and announced < 2**32 - 8 and path.stat().st_size < announced:
        raise InputError(path, f"is truncated: {path.stat().st_size} of {announced} bytes")


def _number(path: Path, name: str, count: int) -> int:
    if not name.isdigit() or int(name) >= count:
        raise InputError(path, f"has no channel {name!r}; channels are numbered 0 to {count - 1}")
    return int(name)
