"""What codings without loss make of recorded mains: size, and time to write and read.

    python -m tools.studies.archive.codings [FILE.npz ...] [--json]

Without files: the shared recordings (../shared/data/waveforms) that are there. Chunks of 0.4 s, as the archive writes
them. Times are the best of several, of one core, for a second of three phases at 20 kHz.
"""

from __future__ import annotations

import io
import json
import lzma
import time
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import soundfile
import typer
from numpy.typing import NDArray

from acqd.sources.load import load_waveform

Samples = NDArray[np.int16]
_SHARED = Path(__file__).parents[4] / "shared/data/waveforms"
_CHUNK = 8_000
_TIMES = 5
_BOX_BYTES = 20_000 * 6 * 2
"""Of a second of three phases."""


def _flac(level: int) -> tuple[Callable[[Samples], bytes], Callable[[bytes, int], Samples]]:
    def encode(x: Samples) -> bytes:
        buffer = io.BytesIO()
        with soundfile.SoundFile(
            buffer, "w", 20_000, x.shape[1], "PCM_16", format="FLAC", compression_level=level / 8
        ) as file:
            file.write(x)
        return buffer.getvalue()

    def decode(data: bytes, _: int) -> Samples:
        return np.asarray(soundfile.read(io.BytesIO(data), dtype="int16", always_2d=True)[0])

    return encode, decode


def _by_bytes(x: Samples) -> bytes:
    """High bytes and low bytes of each channel apart."""
    return np.ascontiguousarray(x.T).view(np.uint8).reshape(x.shape[1], -1, 2).transpose(0, 2, 1).tobytes()


def _from_bytes(data: bytes, channels: int) -> Samples:
    apart = np.frombuffer(data, np.uint8).reshape(channels, 2, -1).transpose(0, 2, 1)
    return np.ascontiguousarray(np.ascontiguousarray(apart).view(np.int16)[:, :, 0].T)


def _less_cycle(x: Samples, cycle: int) -> Samples:
    """Minus the sample a cycle before; int16 wraps, and back."""
    y = x.copy()
    y[cycle:] = x[cycle:] - x[:-cycle]
    return y


def _more_cycle(y: Samples, cycle: int) -> Samples:
    x = y.copy()
    for k in range(cycle, len(x), cycle):
        x[k : k + cycle] += x[k - cycle : k][: len(x[k : k + cycle])]
    return x


def _differences(x: Samples) -> Samples:
    return np.diff(x, n=2, axis=0, prepend=np.zeros((2, x.shape[1]), np.int16)).astype(np.int16)


def _sums(y: Samples) -> Samples:
    return np.cumsum(np.cumsum(y, axis=0, dtype=np.int16), axis=0, dtype=np.int16)


def _codings(cycle: int, channels: int) -> dict[str, tuple[Callable[..., bytes], Callable[..., Samples]]]:
    level3 = _flac(3)
    return {
        **{f"FLAC {level}": _flac(level) for level in (0, 3, 5, 8)},
        "previous cycle, FLAC 3": (
            lambda x: level3[0](_less_cycle(x, cycle)),
            lambda d, n: _more_cycle(level3[1](d, n), cycle),
        ),
        "deflate 1": (
            lambda x: zlib.compress(x.tobytes(), 1),
            lambda d, n: np.frombuffer(zlib.decompress(d), np.int16).reshape(n, channels),
        ),
        "2nd differences by bytes, deflate 1": (
            lambda x: zlib.compress(_by_bytes(_differences(x)), 1),
            lambda d, _: _sums(_from_bytes(zlib.decompress(d), channels)),
        ),
        "previous cycle by bytes, deflate 1": (
            lambda x: zlib.compress(_by_bytes(_less_cycle(x, cycle)), 1),
            lambda d, _: _more_cycle(_from_bytes(zlib.decompress(d), channels), cycle),
        ),
        "2nd differences by bytes, LZMA 1": (
            lambda x: lzma.compress(_by_bytes(_differences(x)), preset=1),
            lambda d, _: _sums(_from_bytes(lzma.decompress(d), channels)),
        ),
    }


def _all(work: Callable[..., Any], given: list[tuple[Any, ...]]) -> None:
    for each in given:
        work(*each)


def _best_s(work: Callable[[], Any]) -> float:
    times = []
    for _ in range(_TIMES):
        begun = time.process_time()
        work()
        times.append(time.process_time() - begun)
    return min(times)


def measured(path: Path) -> list[dict[str, Any]]:
    """Every coding on one recording."""
    waveform = load_waveform(path)
    codes, form = np.asarray(waveform.codes, dtype=np.int16), waveform.form
    chunks = [np.ascontiguousarray(codes[k : k + _CHUNK]) for k in range(0, len(codes), _CHUNK)][:40]
    raw = sum(chunk.nbytes for chunk in chunks)
    rows = []
    for name, (encode, decode) in _codings(round(form.rate / form.f_nominal), codes.shape[1]).items():
        data = [encode(chunk) for chunk in chunks]
        back = [decode(each, len(chunk)) for each, chunk in zip(data, chunks, strict=True)]
        if not all(np.array_equal(a, b) for a, b in zip(back, chunks, strict=True)):
            raise SystemExit(f"{name} has lost something")
        seconds = raw / _BOX_BYTES
        write_s = _best_s(partial(_all, encode, [(chunk,) for chunk in chunks]))
        read_s = _best_s(partial(_all, decode, [(a, len(b)) for a, b in zip(data, chunks, strict=True)]))
        rows.append({
            "recording": path.parent.name, "coding": name, "share": round(sum(map(len, data)) / raw, 3),
            "write_ms": round(1e3 * write_s / seconds, 2), "read_ms": round(1e3 * read_s / seconds, 2),
            "GB_a_day": round(sum(map(len, data)) / raw * _BOX_BYTES * 86_400 / 1e9, 2),
        })  # fmt: skip
    return rows


def codings(
    files: Annotated[list[Path] | None, typer.Argument(help="NPZ recordings of 16-bit codes.")] = None,
    json_: Annotated[bool, typer.Option("--json", help="Machine-readable output.")] = False,
) -> None:
    """Print a table."""
    rows = [row for path in files or sorted(_SHARED.glob("*/*.npz")) for row in measured(path)]
    if json_:
        print(json.dumps(rows))
        return
    print(f"{'recording':22s}{'coding':38s}{'of raw':>8s}{'write ms':>10s}{'read ms':>9s}{'GB/day':>8s}")
    for row in rows:
        print(
            f"{row['recording']:22s}{row['coding']:38s}{row['share']:8.3f}{row['write_ms']:10.2f}{row['read_ms']:9.2f}"
            f"{row['GB_a_day']:8.2f}"
        )


if __name__ == "__main__":
    typer.run(codings)
