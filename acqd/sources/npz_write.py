"""Waveforms as NPZ files, which `acqd replay` reads: codes and scales, or volts and amperes."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from acqd.sources.waveform import Waveform


def npz_bytes(waveform: Waveform) -> bytes:
    """The file: 16-bit codes as they are, other values in V and A."""
    form, codes = waveform.form, waveform.codes
    u, i = codes[:, 0::2].T, codes[:, 1::2].T
    u_scale, i_scale = np.array(form.scale[0::2]), np.array(form.scale[1::2])
    content: dict[str, Any] = {"fs": form.rate, "f_nominal": form.f_nominal, "simulated": int(waveform.simulated)}
    if waveform.start_utc_ns is not None:
        content["start_utc_ns"] = np.int64(waveform.start_utc_ns)
    if form.bits == 16:
        content |= {"u_code": u, "i_code": i, "u_V_per_digit": _one(u_scale), "i_A_per_digit": _one(i_scale)}
    else:
        content |= {"u_V": u * u_scale[:, None], "i_A": i * i_scale[:, None]}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **content)
    return buffer.getvalue()


def _one(scale: np.ndarray) -> np.ndarray:
    """One number where all phases have the same."""
    return scale[:1].reshape(()) if (scale == scale[0]).all() else scale
