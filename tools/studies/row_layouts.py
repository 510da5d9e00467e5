"""Bytes and insert rate of layouts of the table of rows in SQLite (ADR 42). Simulated values.

python -m tools.studies.row_layouts [--rows 400000] [--devices 1 50]
"""

from __future__ import annotations

import argparse
import random
import sqlite3
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

BATCH = 2_000
T0 = 133_444_000_000_000_000
CHANNELS = ("L1", "L2", "L3", "total")

TEXT_KEY = """
CREATE TABLE power (device TEXT, channel TEXT, boot TEXT, seq INTEGER, time TEXT, filetime INTEGER, Vrms REAL,
 Irms REAL, P REAL, S REAL, PF REAL, f REAL, W REAL, flags TEXT, "schema" INTEGER,
 PRIMARY KEY (device, channel, boot, seq));
CREATE INDEX power_filetime ON power (filetime)
"""
NUMBERED = """
CREATE TABLE power (stream INTEGER, seq INTEGER, filetime INTEGER, Vrms REAL, Irms REAL, P REAL, S REAL, PF REAL,
 f REAL, W REAL, flags INTEGER, PRIMARY KEY (stream, seq)) WITHOUT ROWID;
CREATE INDEX power_filetime ON power (filetime)
"""
BY_TIME = """
CREATE TABLE power (filetime INTEGER, stream INTEGER, seq INTEGER, Vrms REAL, Irms REAL, P REAL, S REAL, PF REAL,
 f REAL, W REAL, flags INTEGER, PRIMARY KEY (filetime, stream)) WITHOUT ROWID;
CREATE UNIQUE INDEX power_key ON power (stream, seq)
"""
BY_WINDOW = """
CREATE TABLE power (run INTEGER, seq INTEGER, channel INTEGER, mark INTEGER, filetime INTEGER, Vrms REAL, Irms REAL,
 P REAL, S REAL, PF REAL, f REAL, W REAL, PRIMARY KEY (run, seq, channel)) WITHOUT ROWID;
CREATE INDEX power_filetime ON power (filetime)
"""
ONE_NUMBER = """
CREATE TABLE power (id INTEGER PRIMARY KEY, mark INTEGER, filetime INTEGER, Vrms REAL, Irms REAL,
 P REAL, S REAL, PF REAL, f REAL, W REAL);
CREATE INDEX power_filetime ON power (filetime)
"""
LAYOUTS = {
    "text key, index on time (as before)": (TEXT_KEY, "text"),
    "numbered streams, key (stream, seq), index on time": (NUMBERED, "numbered"),
    "by time: key (time, stream), unique (stream, seq)": (BY_TIME, "time"),
    "by window: key (run, seq, channel), S and PF where they do not follow, index on time": (BY_WINDOW, "window"),
    "the same, with run, seq and channel as one number, the row's own": (ONE_NUMBER, "number"),
}


def rows(count: int, devices: int) -> Iterator[tuple[int, int, int, tuple[float, ...]]]:
    """Device, window, channel and Vrms, Irms, P, S, PF, f, W: doubles with all their digits, as measured ones have."""
    draw, seq, made = random.Random(1), 0, 0
    while made < count:
        for device in range(devices):
            f, sums = 50 + draw.gauss(0, 0.01), [0.0] * 3
            for channel in range(4):
                V, A = 230 + draw.gauss(0, 1), 5 + draw.gauss(0, 1)
                P = V * A * draw.uniform(0.8, 1)
                S = V * A if channel < 3 else sum(sums) * 1.000001
                sums[channel % 3] = S
                yield device, seq, channel, (V, A, P, S, P / S, f, 1000 + seq * 1e-5 + draw.random() * 1e-6)
                made += 1
        seq += 1


def values(kind: str, row: tuple[int, int, int, tuple[float, ...]]) -> tuple[object, ...]:
    """A row as a layout has it."""
    device, seq, channel, numbers = row
    ticks = T0 + seq * 400_000 + device * 1_234
    if kind == "text":
        stamp = f"2023-11-14T{seq // 90_000 % 24:02d}:{seq // 1_500 % 60:02d}:{seq / 25 % 60:09.6f}Z"
        return f"cell{device:02d}", CHANNELS[channel], f"{device:012x}", seq, stamp, ticks, *numbers, "[]", 1
    if kind == "numbered":
        return device * 4 + channel, seq, ticks, *numbers, 0
    if kind == "time":
        return ticks, device * 4 + channel, seq, *numbers, 0
    V, A, P, S, _, f, W = numbers
    kept = channel // 3, ticks, V, A, P, S if channel == 3 else None, None, f, W
    return (device, seq, channel, *kept) if kind == "window" else (device << 34 | seq << 2 | channel, *kept)


def measure(schema: str, kind: str, count: int, devices: int, folder: Path) -> tuple[float, float]:
    """Bytes a row and rows a second, commits included."""
    path = folder / f"{kind}-{devices}.sqlite"
    made = [values(kind, row) for row in rows(count, devices)]
    connection = sqlite3.connect(path, isolation_level=None)
    connection.executescript(f"PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; {schema}")
    places = ", ".join("?" * len(made[0]))
    begun = time.perf_counter()
    for k in range(0, len(made), BATCH):
        connection.execute("BEGIN IMMEDIATE")
        connection.executemany(f"INSERT INTO power VALUES ({places}) ON CONFLICT DO NOTHING", made[k : k + BATCH])
        connection.execute("COMMIT")
    seconds = time.perf_counter() - begun
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()
    size = path.stat().st_size
    path.unlink()
    return size / len(made), len(made) / seconds


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=400_000)
    parser.add_argument("--devices", type=int, nargs="+", default=[1, 50])
    asked = parser.parse_args()
    print("| layout | devices | bytes a row | rows/s |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory(dir=".") as folder:
        for name, (schema, kind) in LAYOUTS.items():
            for devices in asked.devices:
                size, rate = measure(schema, kind, asked.rows, devices, Path(folder))
                print(f"| {name} | {devices} | {size:.1f} | {rate:,.0f} |")


if __name__ == "__main__":
    main()
