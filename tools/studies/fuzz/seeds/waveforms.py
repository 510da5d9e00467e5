"""Recordings of voltage and current in every format of acqd.sources."""

from __future__ import annotations

import io
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from acqd.arrays import Floats
from tools.studies.fuzz.mutate import Files

_RATE = 5_000.0
_BEGIN = 1_700_000_000.0


@cache
def _waves(rows: int = 24) -> Floats:
    """[rows, 2] V and A."""
    t = np.arange(rows) / _RATE
    return np.column_stack([325 * np.sin(314.159 * t), 2 * np.sin(314.159 * t - 0.3)])


def _csv(header: str, separator: str, begin_s: float) -> bytes:
    rows = [(begin_s + k / _RATE, *values) for k, values in enumerate(_waves().tolist())]
    text = "\n".join(separator.join(f"{value:.6f}" for value in row) for row in rows)
    if separator == ";":
        text = text.replace(".", ",")
    return f"{header.replace(',', separator)}\n{text}\n".encode()


def csv_waveforms() -> list[Files]:
    """Points and commas, with and without the date."""
    return [
        {"a.csv": _csv("time,u1,i1", ",", 0.0)},
        {"a.csv": _csv("t_s,U1 [V],I1 [A]", ";", 0.0)},
        {"a.csv": _csv('"time","v1","i1"', "\t", _BEGIN)},
    ]


def npz_waveforms() -> list[Files]:
    """One and three phases, deflated and plain."""
    found: list[Files] = []
    for phases, save in ((1, np.savez), (3, np.savez_compressed)):
        codes = np.tile(np.rint(10 * _waves().T[:1]).astype(np.int16), (phases, 1))
        more: dict[str, Any] = (
            {"start_utc_ns": np.int64(1.7e18), "f_nominal": 50.0, "simulated": np.int8(1)} if phases == 3 else {}
        )
        buffer = io.BytesIO()
        save(buffer, u_code=codes, i_code=codes, u_V_per_digit=0.02, i_A_per_digit=1e-4, fs=_RATE, **more)
        found.append({"a.npz": buffer.getvalue()})
    return found


def _sound(kind: str, subtype: str) -> bytes:
    import soundfile

    buffer = io.BytesIO()
    soundfile.write(buffer, _waves(400) / 400, int(_RATE), format=kind, subtype=subtype)
    return buffer.getvalue()


def wav_waveforms() -> list[Files]:
    """Integers and floats."""
    return [{"a.wav": _sound("WAV", "PCM_16")}, {"a.wav": _sound("WAV", "FLOAT")}, {"a.wav": _sound("WAVEX", "PCM_24")}]


def flac_waveforms() -> list[Files]:
    """16 and 24 bits."""
    return [{"a.flac": _sound("FLAC", "PCM_16")}, {"a.flac": _sound("FLAC", "PCM_24")}]


def _cfg(kind: str, samples: int) -> str:
    channels = ["1,UA,A,,V,0.02,0,0,-32767,32767,1,1,P", "2,IA,A,,A,0.0001,0,0,-32767,32767,1,1,P"]
    stamp = "22/11/2026,10:00:00.000000"
    lines = ["station,1,1999", "2,2A,0D", *channels, "50", "1", f"{_RATE:g},{samples}", stamp, stamp, kind, "1"]
    return "\r\n".join([*lines, ""])


def _codes() -> np.ndarray:
    return np.rint(_waves() / [0.02, 0.0001]).astype(np.int16)


def comtrade_waveforms() -> list[Files]:
    """ASCII and binary."""
    codes = _codes()
    text = "".join(f"{k + 1},{200 * k},{u},{i}\r\n" for k, (u, i) in enumerate(codes.tolist()))
    binary = b"".join(
        np.array([k + 1, 200 * k], "<u4").tobytes() + row.astype("<i2").tobytes() for k, row in enumerate(codes)
    )
    return [
        {"a.cfg": _cfg("ASCII", len(codes)).encode(), "a.dat": text.encode()},
        {"a.cfg": _cfg("BINARY", len(codes)).encode(), "a.dat": binary},
    ]


def cff_waveforms() -> list[Files]:
    """All in one file."""
    pair = comtrade_waveforms()[0]
    text = b"--- file type: CFG ---\r\n" + pair["a.cfg"] + b"--- file type: INF ---\r\n--- file type: HDR ---\r\n"
    return [{"a.cff": text + b"--- file type: DAT ASCII ---\r\n" + pair["a.dat"]}]


def _written(writers: dict[str, Any], names: list[str]) -> list[Files]:
    """What functions write into an empty folder."""
    found: list[Files] = []
    for name in names:
        with tempfile.TemporaryDirectory(prefix="acqd-seed-") as folder:
            writers[name](Path(folder))
            found.append({path.name: path.read_bytes() for path in Path(folder).iterdir()})
    return found


def mat_waveforms() -> list[Files]:
    """Level 4 and 5: columns, a compressed struct, a matrix with names."""
    from tests.sources.arrays.writers import WRITERS

    return _written(WRITERS, ["columns", "struct", "matrix", "simulink", "level 4"])


def hdf5_waveforms() -> list[Files]:
    """Datasets with attributes, and a table."""
    from tests.sources.arrays.writers import WRITERS

    return _written(WRITERS, ["attributes", "table"])


def parquet_waveforms() -> list[Files]:
    """A table."""
    from tests.sources.arrays.writers import WRITERS

    return _written(WRITERS, ["parquet"])


def arrow_waveforms() -> list[Files]:
    """Arrow's stream format."""
    from tests.sources.arrays.writers import WRITERS

    return _written(WRITERS, ["stream"])


def tdms_waveforms() -> list[Files]:
    """Two channels, and one that is slower."""
    from tests.sources.arrays.writers import WRITERS

    return _written(WRITERS, ["tdms"])


def _shots(name: str, write: Any) -> Files:
    from tests.sources.scopes.writers import I, U

    return {name.format(1): write(U, "V", channel=1), name.format(2): write(I, "A", channel=2)}


def trc_waveforms() -> list[Files]:
    """Two traces of LeCroy."""
    from tests.sources.scopes.writers import lecroy

    return [_shots("C{}a.trc", lecroy)]


def isf_waveforms() -> list[Files]:
    """Two traces of Tektronix."""
    from tests.sources.scopes.writers import isf

    return [_shots("a_CH{}.isf", isf)]


def wfm_waveforms() -> list[Files]:
    """Two traces of Tektronix through the library."""
    from tests.sources.scopes.writers import tektronix_wfm

    return [_shots("a_CH{}.wfm", tektronix_wfm)]
