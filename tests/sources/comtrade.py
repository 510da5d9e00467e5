"""Writes COMTRADE recordings in every edition and file type, independently of acqd."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.mains import Mains

_NUMBER = {"BINARY": "<i2", "BINARY32": "<i4", "FLOAT32": "<f4"}


@dataclass
class Recording:
    """A three-phase or one-phase recording of `mains`: channels VA, IA, VB ... in V and A."""

    mains: Mains
    edition: int = 1999
    kind: str = "BINARY"
    names: tuple[str, ...] = ("VA", "IA", "VB", "IB", "VC", "IC")
    offset: float = 0.0
    skews_us: tuple[float, ...] = (0.0,) * 6
    ratios: tuple[tuple[float, float, str], ...] = ((1.0, 1.0, "P"),) * 6
    segments: tuple[tuple[float, int], ...] = ()
    stamp: str = "25/06/2007,19:13:57.789757"
    tail: tuple[str, ...] = ("1",)
    station: str = "Station"
    limits: tuple[int, int] = (-32767, 32767)
    numbers: np.ndarray | None = field(default=None)

    @property
    def codes(self) -> np.ndarray:
        return self.mains.codes if self.numbers is None else self.numbers

    def header(self, encoding: str = "utf-8") -> bytes:
        channels = self.codes.shape[1]
        first = f"{self.station},1" if self.edition == 1991 else f"{self.station},1,{self.edition}"
        lines = [first, f"{channels},{channels}A,0D"]
        for k in range(channels):
            unit, ratio = "VA"[k % 2], self.ratios[k]
            fields = [k + 1, self.names[k], "ABC"[k // 2], "", unit, repr(self.mains.scale[k]), self.offset]
            fields += [self.skews_us[k], *self.limits]
            lines.append(",".join(map(str, fields if self.edition == 1991 else [*fields, *ratio])))
        segments = self.segments or ((self.mains.rate, len(self.codes)),)
        lines += ["50", str(len(segments)), *(f"{rate:g},{end}" for rate, end in segments)]
        lines += [self.stamp, self.stamp, self.kind, *(self.tail if self.edition > 1991 else ())]
        return ("\r\n".join(lines) + "\r\n").encode(encoding)

    def data(self) -> bytes:
        micros = np.rint(np.arange(len(self.codes)) * 1e6 / self.mains.rate).astype(np.int64)
        if self.kind == "ASCII":
            texts = [",".join(map(str, row)) for row in self.codes]
            rows = [f"{n + 1},{t},{text}" for n, (t, text) in enumerate(zip(micros, texts, strict=True))]
            return ("\r\n".join(rows) + "\r\n\x1a").encode()
        numbers = self.codes.astype(_NUMBER[self.kind])
        head = (struct.pack("<II", n + 1, t) for n, t in enumerate(micros.tolist()))
        return b"".join(a + row.tobytes() for a, row in zip(head, numbers, strict=True))

    def write(self, folder: Path, encoding: str = "utf-8") -> Path:
        (folder / "r.cfg").write_bytes(self.header(encoding))
        (folder / "r.dat").write_bytes(self.data())
        return folder / "r.cfg"
