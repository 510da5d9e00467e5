"""Small valid inputs of each parser."""

from __future__ import annotations

import io
import tempfile
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from acqd.arrays import Floats
from tools.studies.fuzz.mutate import Files

_ROOT = Path(__file__).parents[3]
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


def _row(**more: Any) -> dict[str, Any]:
    return {
        "device": "box", "channel": "L1", "boot": "b1", "seq": 7, "time": "2026-11-22T10:00:00.000000Z",
        "filetime": 134_082_324_000_000_000, "Vrms": 230.1, "Irms": 1.2, "P": 250.0, "S": 276.1, "PF": 0.9, "f": 50.01,
        "W": 1.5, "flags": ["simulated"], "schema": 1,
    } | more  # fmt: skip


def rows() -> list[Files]:
    """A row, and one without mains."""
    return [{"row.json": orjson.dumps(_row())}, {"row.json": orjson.dumps(_row(f=None, PF=None, flags=["no_mains"]))}]


def receipts() -> list[Files]:
    """Of rows, and the answer to a question."""
    stored = [{"channel": "L1", "boot": "b1", "seq": [[0, 24], [26, 49]]}]
    last = [{"channel": "L1", "boot": "b1", "seq": 49, "W": 0.5}]
    return [
        {"receipt.json": orjson.dumps({"sink": "s", "stored": stored, "schema": 1})},
        {"receipt.json": orjson.dumps({"sink": "s", "stored": [], "schema": 1, "last": last})},
    ]


def asks() -> list[Files]:
    """Questions; a status; a summary: what is heard is one of them."""
    who = {"instance": "i2", "boot": "b2", "host": "h", "since": "2026-11-22T10:00:00Z", "taken": False}
    heard: list[dict[str, Any]] = [
        {"ask": "last_rows", "boot": "b1", "who": None, "schema": 1},
        {"ask": "name", "boot": "", "who": who, "schema": 1},
        {"state": "online", "boot": "b2", "started": "2026-11-22T10:00:00Z", "name": who},
        {"channel": "L1", "boot": "b", "seq": 3, "W_import": 1.0, "W_export": 0.0},
    ]
    return [{"heard.json": orjson.dumps(one)} for one in heard]


def events() -> list[Files]:
    """The begin of a dip, and a rapid change."""
    dip = {
        "device": "box", "boot": "b1", "number": 7, "kind": "dip", "time": "2026-11-22T10:00:00.000000Z",
        "filetime": 134_082_324_000_000_000, "duration": None, "extreme": 161.0, "reference": 230.0, "sliding": False,
        "steady_change": None, "phases": ["L1", "L3"], "flags": ["simulated"], "waveform": "a.npz", "schema": 1,
    }  # fmt: skip
    change = dip | {"kind": "rvc", "duration": 0.02, "steady_change": 14.5, "waveform": None}
    return [{"event.json": orjson.dumps(dip)}, {"event.json": orjson.dumps(change)}]


def configurations() -> list[Files]:
    """The shipped file and smaller ones of other sources."""
    meters = b'[source]\nkind = "meters"\nhost = "h"\n[[source.meters]]\nname = "m"\nprofile = "em340"\nunit = 3\n'
    replay = b'[source]\nkind = "replay"\nfile = "a.csv"\nmap = "u1=A,i1=B"\nrate = 2e4\n[mqtt]\nca_file = "x.pem"\n'
    return [{"acqd.toml": (_ROOT / "config" / "acqd.toml").read_bytes()}, {"acqd.toml": meters}, {"acqd.toml": replay}]


def _motion(rows: int = 60) -> Floats:
    """[rows, 7]: time [s] and six angles [rad]."""
    t = np.arange(rows) * 0.04
    return np.column_stack([_BEGIN + t, 0.3 * np.sin(t[:, None] * np.arange(1, 7))])


def _motion_text(separator: str, names: list[str]) -> bytes:
    lines = [separator.join(f"{value:.4f}" for value in row) for row in _motion().tolist()]
    return "\n".join([separator.join(names), *lines, ""]).encode()


def logs() -> list[Files]:
    """Generic headers with several separators."""
    names = ["time", *(f"q{k}" for k in range(1, 7))]
    return [{"robot.log": _motion_text(separator, names)} for separator in ",; "]


def tables() -> list[Files]:
    """With a header, without, with decimal commas."""
    without = b"\n".join(b" ".join(b"%.3f" % value for value in row) for row in _motion(20).tolist())
    commas = logs()[1]["robot.log"].replace(b".", b",")
    return [{"robot.csv": logs()[0]["robot.log"]}, {"robot.csv": without}, {"robot.csv": commas}]


@cache
def grey_box() -> Any:
    """A grey box of a UR10e."""
    from acqd.models.greybox.model import GreyBox
    from acqd.models.greybox.parameters import Layout, prior
    from acqd.robot import load_description
    from acqd.robot.arm import Arm
    from acqd.robot.dynamics import inertial_parameters
    from acqd.robot.newton_euler import Chain

    robot = load_description("ur10e")
    layout = Layout(robot.axes, ("brake",))
    values = prior(layout, robot, inertial_parameters(Arm(robot)), 120.0, 0.04).mean.copy()
    values[layout.part("coulomb")], values[layout.part("lag")] = 5.0, 0.012
    return GreyBox(Chain.of(robot), layout, values, 0.04, np.ones(1))


@cache
def _bundle() -> tuple[bytes, bytes]:
    from safetensors.numpy import save

    from acqd.models.greybox.bundle_io import arrays_of

    angles = {"low": [-1.0] * 6, "high": [1.0] * 6}
    metadata = {
        "format": 1, "kind": "grey_box", "name": "trial", "robot": "UR10e", "description": "ur10e", "axes": 6,
        "step_s": 0.04, "inputs": [], "signals": ["brake"],
        "envelope": dict.fromkeys(("q_rad", "qd_rad_s", "qdd_rad_s2"), angles),
        "effects": [], "provenance": {"fit_recordings": [], "validation_recordings": [], "manifest_sha256": ""},
    }  # fmt: skip
    arrays = {name: np.ascontiguousarray(array) for name, array in arrays_of(grey_box()).items()}
    return orjson.dumps(metadata, option=orjson.OPT_INDENT_2), save(arrays)


def bundles() -> list[Files]:
    """A grey box. Its bundle.json names no hash: with one, every mutation of the weights would be refused by it."""
    metadata, weights = _bundle()
    return [{"bundle.json": metadata, "weights.safetensors": weights}]


def _power_rows(count: int = 12) -> list[dict[str, Any]]:
    begin = 134_082_324_000_000_000
    return [_row(seq=k, filetime=begin + 400_000 * k, P=200.0 + k) for k in range(count)]


def power_csv() -> list[Files]:
    """With FILETIME, RFC 3339 and Unix times."""
    stamps = [f"2026-11-22T10:00:{k:02d}.04Z,{200 + k}" for k in range(12)]
    plain = [f"{_BEGIN + 0.04 * k:.3f},{200 + k},230" for k in range(12)]
    filetimes = [f'{row["filetime"]},{row["P"]},box,L1,"[]"' for row in _power_rows()]
    return [
        {"p.csv": "\n".join(["time,P", *stamps, ""]).encode()},
        {"p.csv": "\n".join(["time,P,Vrms", *plain, ""]).encode()},
        {"p.csv": "\n".join(["filetime,P,device,channel,flags", *filetimes, ""]).encode()},
    ]


def power_json_lines() -> list[Files]:
    """As the daemon writes them."""
    return [{"p.jsonl": b"\n".join(map(orjson.dumps, _power_rows()))}]


def power_parquet() -> list[Files]:
    """A small table."""
    import pyarrow
    import pyarrow.parquet

    buffer = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(_power_rows()), buffer)
    return [{"p.parquet": buffer.getvalue()}]


def robots() -> list[Files]:
    """A shipped description."""
    return [{"robot.toml": (_ROOT / "acqd" / "robot" / "descriptions" / "ur10e.toml").read_bytes()}]


def urdf() -> list[Files]:
    """Two links, one joint, all elements that are read."""
    body = (
        '<inertial><origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1"'
        ' iyz="0" izz="0.1"/></inertial><collision><geometry><cylinder radius="0.1" length="0.3"/></geometry>'
        "</collision>"
    )
    joint = (
        '<joint name="j1" type="revolute"><origin xyz="0 0 0.2" rpy="0 0 0"/><parent link="a"/><child link="b"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="2"/>'
        '<dynamics damping="0.1" friction="0.2"/></joint>'
    )
    links = f'<link name="a">{body}</link>\n<link name="b">{body}</link>'
    text = f'<?xml version="1.0"?>\n<robot name="r">\n{links}\n{joint}\n</robot>\n'
    return [{"robot.urdf": text.encode()}]


def profiles() -> list[Files]:
    """Two shipped meter profiles."""
    folder = _ROOT / "acqd" / "sources" / "meters" / "profiles"
    return [{"meter.toml": (folder / f"{name}.toml").read_bytes()} for name in ("em340", "sdm630")]


def sampled_values() -> list[Files]:
    """A frame of IEC 61850-9-2LE with one ASDU of eight values."""
    data = b"".join(value.to_bytes(4, "big", signed=True) + b"\x00" * 4 for value in range(0, 8000, 1000))
    asdu = b"\x80\x06MU0101\x82\x02\x00\x07\x83\x04\x00\x00\x00\x01\x85\x01\x02\x87" + bytes([len(data)]) + data
    sequence = b"\x30" + bytes([len(asdu)]) + asdu
    pdu = b"\x80\x01\x01\xa2" + bytes([len(sequence)]) + sequence
    apdu = b"\x60" + bytes([len(pdu)]) + pdu
    header = b"\x01\x0c\xcd\x04\x00\x01" + b"\x02" * 6 + b"\x88\xba\x40\x00"
    return [{"frame.bin": header + (len(apdu) + 8).to_bytes(2, "big") + b"\x00" * 4 + apdu}]


def joints() -> list[Files]:
    """A row of live joints."""
    return [{"joints.json": orjson.dumps({"time": _BEGIN, "q": [0.1] * 6, "brake": 1, "tool": 0})}]


def as_zip(files: Files) -> bytes:
    """The files as one archive, to keep an input that fails."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()
