"""Mean squares of voltages over a few samples each: what a flickermeter needs of a fast stream."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import Codes, StreamFormat
from acqd.metering.kernel.compiled import quality_library


def mean_squares(u: Floats, length: int) -> Floats:
    """Of every `length` samples of `u` [phases, samples], a multiple of it: [phases, samples / length]."""
    parts = u.reshape(len(u), -1, length)
    return np.asarray(np.einsum("psk,psk->ps", parts, parts) / length)


def mean_squares_of_codes(codes: Codes, form: StreamFormat, length: int) -> Floats:
    """The same of the voltages in codes [samples, channels], V^2.

    In C where there is a compiler (`kernel/quality.c`).
    """
    scale = np.array(form.scale[0::2], dtype=np.float64)
    library = quality_library()
    if library is None or codes.dtype != form.dtype or not codes.flags.c_contiguous:
        return mean_squares(np.ascontiguousarray(codes[:, 0::2].T * scale[:, None]), length)
    out = np.empty((form.phases, len(codes) // length))
    library.acqd_mean_squares(codes.ctypes.data, form.bits, *out.shape, length, scale.ctypes.data, out.ctypes.data)
    return out
