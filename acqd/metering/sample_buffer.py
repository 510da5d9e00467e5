"""The unbroken samples that windows are cut from, in an array that stays where it is as long as it can."""

from __future__ import annotations

import numpy as np

from acqd.metering.block import Codes
from acqd.metering.packed import State, packed, unpacked

_ROOM = 1 << 14
"""Samples; a larger array is only as large as it must be."""


class SampleBuffer:
    """Samples first .. `end` of a stream, at positions `begin` .. of `codes`."""

    def __init__(self, codes: Codes, origin: int) -> None:
        """`codes` [samples, channels], of which the first is number `origin`."""
        self.codes: Codes = np.empty((0, codes.shape[1]), codes.dtype)
        """[room, channels], contiguous."""
        self.begin = self._to = 0
        self.origin = self.end = origin
        """Numbers of the first sample, at position `begin`, and after the newest one."""
        self.append(codes)

    @property
    def run(self) -> Codes:
        """[samples, channels] a view, valid until the next samples."""
        return self.codes[self.begin : self._to]

    def restart(self, codes: Codes, origin: int) -> None:
        """Forget all; the next samples begin with number `origin`."""
        self.begin = self._to = 0
        self.origin = self.end = origin
        self.append(codes)

    def state(self) -> State:
        """The samples, to go on with later."""
        return {"codes": packed(self.run), "origin": self.origin}

    @classmethod
    def of(cls, state: State) -> SampleBuffer:
        """Goes on where `state` was taken."""
        return cls(unpacked(state["codes"]), int(state["origin"]))

    def append(self, codes: Codes) -> None:
        """Copy the next samples. Codes of another type make an array of a type that holds both."""
        begin, count = self._to, len(codes)
        if begin + count > len(self.codes) or codes.dtype != self.codes.dtype:
            self._make_room(codes)
            begin = self._to
        self.codes[begin : begin + count] = codes
        self._to = begin + count
        self.end += count

    def forget(self, number: int) -> None:
        """Samples before `number`."""
        count = number - self.origin
        if count > 0:
            self.begin += count
            self.origin += count

    def _make_room(self, codes: Codes) -> None:
        """Move the samples to the front, of another array where this one is too small."""
        old, kept = self.run, self._to - self.begin
        least, dtype = kept + len(codes), np.promote_types(old.dtype, codes.dtype)
        if least > len(self.codes) or dtype != old.dtype:
            self.codes = np.empty((least if least > _ROOM else 8 * least, old.shape[1]), dtype)
        self.codes[:kept] = old
        self.begin, self._to = 0, kept
