"""Arrays inside the JSON of a saved state."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from acqd.metering.block import Codes

State = dict[str, Any]
"""What an object must know of the stream so far, as JSON: numbers are the same to the last bit when they are read."""
_TYPES = ("<i2", "<i4", "<i8", "<f8")


def packed(codes: Codes) -> State:
    """Codes [samples, channels] as JSON."""
    fixed = np.ascontiguousarray(codes, dtype=codes.dtype.newbyteorder("<"))
    return {"type": fixed.dtype.str, "shape": list(fixed.shape), "base64": base64.b64encode(fixed.tobytes()).decode()}


def unpacked(state: State) -> Codes:
    """The codes. Raises ValueError."""
    if state["type"] not in _TYPES:
        raise ValueError(f"codes of type {state['type']!r}")
    content = np.frombuffer(base64.b64decode(state["base64"]), dtype=state["type"])
    native = content.astype(content.dtype.newbyteorder("="))
    return np.asarray(native.reshape(state["shape"]))
