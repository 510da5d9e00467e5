"""Waveforms as COMTRADE files of IEC 60255-24:2013 (IEEE C37.111-2013), with data of 32-bit integers (BINARY32)."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acqd.atomic import write_complete
from acqd.errors import UserError
from acqd.sources.comtrade.header import SIMULATED
from acqd.sources.waveform import Waveform

_LARGEST = 2**31 - 1
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_STAMPS = 2**32 - 2  # the largest that is not "missing"


@dataclass(frozen=True, slots=True)
class _Content:
    """The two parts of a recording."""

    header: str
    data: bytes


def files_of(path: Path) -> tuple[Path, ...]:
    """Files that a recording is written into by this name: .cfg and .dat are two of one recording."""
    if path.suffix.lower() in (".cfg", ".dat"):
        return path.with_suffix(".cfg"), path.with_suffix(".dat")
    return (path,)


def write_comtrade(path: Path, waveform: Waveform, station: str = "acqd") -> None:
    """`path` .cff: both parts in one file; .cfg or .dat: two files. Raises UserError, OperationError."""
    content = _content(waveform, station)
    suffix = path.suffix.lower()
    if suffix == ".cff":
        front = f"--- file type: CFG ---\r\n{content.header}--- file type: DAT BINARY32: {len(content.data)} ---\r\n"
        write_complete(path, front.encode() + content.data)
        return
    if suffix not in (".cfg", ".dat"):
        raise UserError(f"{path}: expected a name that ends in .cff, .cfg or .dat")
    write_complete(path.with_suffix(".dat"), content.data)
    write_complete(path.with_suffix(".cfg"), content.header.encode())


def _content(waveform: Waveform, station: str) -> _Content:
    codes, scale = _integers(waveform)
    count, rate = len(codes), waveform.form.rate
    factor = time_factor(count, rate)
    start = _stamp(waveform.start_utc_ns or 0)
    name = SIMULATED if waveform.simulated else "measured"
    channels = [_channel(k, scale[k]) for k in range(len(scale))]
    lines = [
        f"{station},{name},2013", f"{len(scale)},{len(scale)}A,0D", *channels, f"{waveform.form.f_nominal:.17g}", "1",
        f"{rate:.17g},{count}", start, start, "BINARY32", str(1000 * factor), "0,0", "F,3", "",
    ]  # fmt: skip
    return _Content("\r\n".join(lines), _records(codes, rate, factor))


def time_factor(count: int, rate: float) -> int:
    """Unit of the samples' times [us] in which those of `count` samples at `rate` [1/s] fit into 32 bits."""
    factor = 1
    while (count - 1) * 1e6 / rate / factor > _STAMPS:
        factor *= 10
    return factor


def _channel(k: int, scale: float) -> str:
    """Number, name, phase, circuit, unit, a, b, skew, least, most, primary, secondary, P: primary values."""
    letter, unit, phase = "UI"[k % 2], "VA"[k % 2], k // 2 + 1
    return f"{k + 1},{letter}{phase},L{phase},,{unit},{scale:.17g},0,0,{-_LARGEST},{_LARGEST},1,1,P"


def _integers(waveform: Waveform) -> tuple[NDArray[np.int32], list[float]]:
    """Codes as they are; physical values in steps of the peak over 2^31 - 1."""
    form, codes = waveform.form, waveform.codes
    if form.bits < 64:
        return codes.astype(np.int32), list(form.scale)
    peaks = np.maximum(np.abs(codes).max(axis=0), 1e-300)
    steps = peaks / _LARGEST
    return np.rint(codes / steps).astype(np.int32), [float(s * f) for s, f in zip(steps, form.scale, strict=True)]


def _records(codes: NDArray[np.int32], rate: float, factor: int) -> bytes:
    """Number of the sample, time in units of `factor` us, values."""
    layout = np.dtype([("number", "<u4"), ("time", "<u4"), ("values", "<i4", (codes.shape[1],))])
    records = np.empty(len(codes), layout)
    k = np.arange(len(codes))
    records["number"] = k + 1
    records["time"] = np.rint(k * 1e6 / rate / factor)
    records["values"] = codes
    return records.tobytes()


def _stamp(utc_ns: int) -> str:
    """`dd/mm/yyyy,hh:mm:ss.nnnnnnnnn`."""
    seconds, fraction = divmod(utc_ns, 1_000_000_000)
    return f"{_EPOCH + timedelta(seconds=seconds):%d/%m/%Y,%H:%M:%S}.{fraction:09d}"
