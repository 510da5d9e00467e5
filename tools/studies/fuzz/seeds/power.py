"""Files of power rows."""

from __future__ import annotations

import io
from typing import Any

import orjson

from tools.studies.fuzz.mutate import Files
from tools.studies.fuzz.seeds.messages import row

_BEGIN = 1_700_000_000.0


def _power_rows(count: int = 12) -> list[dict[str, Any]]:
    begin = 134_082_324_000_000_000
    return [row(seq=k, filetime=begin + 400_000 * k, P=200.0 + k) for k in range(count)]


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
