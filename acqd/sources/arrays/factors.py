"""Factors and offsets beside samples that files name in words of their own: nobody knows whether they are applied."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
"""Of `ct_ratio`, `CTRatio`, `calibration factor`."""
_FACTOR = re.compile(
    r"scal(e|es|ing)|\w*factor|gain|y?mult|multipli\w+|calibration|conversion|slope|coeff\w*|sensitivity|resolution"
    r"|ratio|lsb|exponent|range|digit"
)
_OFFSET = re.compile(r"offsets?|intercept|bias")
_OTHER_WORDS = """
    time times timing date day due year utc zone timezone start trigger delay index sample samples sampling bit bits
    byte bytes x xaxis s sec ms us ns power crest form duty noise aspect decimation downsampling oversampling version
"""
_OTHER = frozenset(_OTHER_WORDS.split())
"""Words beside these that say that it is about something else than the size of the samples."""
_COEFFICIENTS = 4
"""Of a polynomial, at most."""


def scales(key: str, value: Any) -> bool:
    """Whether an attribute or a field beside samples is a factor or an offset that may still have to be applied."""
    words = [word.lower() for word in _WORD.findall(key)]
    listed = np.asarray(value).reshape(-1)
    if listed.dtype.kind not in "iuf" or not 0 < listed.size <= _COEFFICIENTS or not np.isfinite(listed).all():
        return False
    if not listed.any() or not _OTHER.isdisjoint(words):
        return False
    if any(_OFFSET.fullmatch(word) for word in words):
        return True
    if ("range" in words and listed.size > 1) or ("resolution" in words and float(listed[0]).is_integer()):
        return False  # the limits of an input, the bits of a converter
    return any(_FACTOR.fullmatch(word) for word in words) and listed.tolist() not in ([1], [0, 1], [1, 0])


def not_applied(name: str, what: str) -> str:
    """A remark about such a factor."""
    return f"{name} has {what}, which is not applied: its meaning is not standard (--u-scale, --i-scale)"
