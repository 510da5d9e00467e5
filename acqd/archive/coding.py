"""Samples as fewer bytes, and back to the last bit.

FLAC (RFC 9639): linear prediction per channel and Rice codes, written by libsndfile and read by C (`flac.c`). It suits
16-bit codes of converters; wider integers fit as long as they have 24 bits. Anything else is sorted by significance of
its bytes and deflated. ADR 39 has the measurement that chose this, ADR 75 says why the reader is in C.
"""

from __future__ import annotations

import ctypes
import functools
import io
import logging
import zlib

import numpy as np
import soundfile

from acqd.c_builds import flac
from acqd.compiling import loaded_library
from acqd.errors import OperationError
from acqd.instruction_sets import best_instruction_set
from acqd.metering.block import Codes

_log = logging.getLogger(__name__)

FLAC16, FLAC24, SORTED = "flac16", "flac24", "sorted"
LEVEL = 0.375
"""libsndfile's scale of 0 to 1 for FLAC's levels 0 to 8: level 3. Higher ones are up to 1 % smaller and dearer."""
_RATE = 20_000  # in the header of FLAC, which few rates fit: the rate of the samples is in the head of the segment
_WIDEST = 2**23
_MOST = 2**24
"""Samples that memory is taken for before their bytes have been read."""


def encode(codes: Codes) -> tuple[str, bytes]:
    """Name of the coding and the bytes of codes [samples, channels]; at least one sample."""
    if codes.dtype == np.int16:
        return FLAC16, _flac(codes, "PCM_16")
    if codes.dtype == np.int32 and codes.min() >= -_WIDEST and codes.max() < _WIDEST:
        return FLAC24, _flac(codes.astype(np.int32) << 8, "PCM_24")  # libsndfile takes the upper bits
    fixed = np.ascontiguousarray(codes.T, dtype=codes.dtype.newbyteorder("<"))
    channels, samples = fixed.shape
    in_order = fixed.view(np.uint8).reshape(channels, samples, -1).transpose(0, 2, 1)
    return SORTED, zlib.compress(in_order.tobytes(), 1)


def decode(coding: str, data: bytes, dtype: np.dtype, samples: int, channels: int) -> Codes:
    """Codes [samples, channels]. Raises ValueError for bytes that are none."""
    try:
        if coding == SORTED:
            codes = _sorted(data, dtype, samples, channels)
        else:
            codes = _unflac(coding, data, samples, channels)
    except (zlib.error, RuntimeError) as error:  # soundfile raises RuntimeErrors
        raise ValueError(f"{coding}: {error}") from None
    if codes.shape != (samples, channels) or codes.dtype != dtype:
        raise ValueError(f"{coding}: {codes.dtype} {codes.shape}, expected {dtype} {(samples, channels)}")
    return codes


def _flac(codes: Codes, subtype: str) -> bytes:
    buffer = io.BytesIO()
    with soundfile.SoundFile(
        buffer, "w", _RATE, codes.shape[1], subtype, format="FLAC", compression_level=LEVEL
    ) as file:
        file.write(codes)
    return buffer.getvalue()


def _unflac(coding: str, data: bytes, samples: int, channels: int) -> Codes:
    if coding not in (FLAC16, FLAC24):
        raise ValueError(f"unknown coding {coding!r}")
    library = _library()
    if library is not None and 0 < samples <= _MOST:
        codes: Codes = np.empty((samples, channels), np.int16 if coding == FLAC16 else np.int32)
        if library.acqd_unflac(data, len(data), channels, samples, 16 if coding == FLAC16 else 24, codes.ctypes.data):
            return codes
    return _unflac_by_libsndfile(coding, data)


def _unflac_by_libsndfile(coding: str, data: bytes) -> Codes:
    """The same of any FLAC stream: the reference, and the reader that says what is wrong with a stream."""
    with soundfile.SoundFile(io.BytesIO(data)) as file:
        if coding == FLAC24:
            return np.asarray(file.read(dtype="int32", always_2d=True) >> 8)
        return np.asarray(file.read(dtype="int16", always_2d=True))


@functools.cache
def _library() -> ctypes.CDLL | None:
    """`flac.c`; None where it cannot be built."""
    try:
        loaded = loaded_library(flac(best_instruction_set()))
    except OperationError as error:
        _log.warning("archived samples are read without C: %s", error)
        return None
    integer = ctypes.c_int64
    loaded.acqd_unflac.argtypes = [ctypes.c_char_p, integer, integer, integer, integer, ctypes.c_void_p]
    loaded.acqd_unflac.restype = integer
    return loaded


def _sorted(data: bytes, dtype: np.dtype, samples: int, channels: int) -> Codes:
    expected = samples * channels * dtype.itemsize
    unpacker = zlib.decompressobj()
    content = unpacker.decompress(data, expected)
    if len(content) != expected:
        raise ValueError(f"{len(content)} bytes, expected {expected}")
    in_order = np.frombuffer(content, np.uint8).reshape(channels, dtype.itemsize, samples).transpose(0, 2, 1)
    plain = np.ascontiguousarray(in_order).view(dtype.newbyteorder("<")).reshape(channels, samples)
    return np.ascontiguousarray(plain.T.astype(dtype))
