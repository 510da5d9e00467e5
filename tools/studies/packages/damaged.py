"""python FOLDER/damaged.py [--files 1500]: what arro3 and pyarrow do with Parquet files that are damaged.

Runs in an environment with pyarrow, numpy, arro3-core and arro3-io. Each copy of one good file is cut off, has bytes
changed anywhere or in its footer, or lacks some. Counted are the copies that are read, those that raise an error, and
those at which the library panics: it prints to stderr by itself, and raises what is no `Exception`. A file that ends
the process is named, and the count ends there (ADR 87).
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

FOOTER_BYTES = 6000
ROWS = 3000


def good_file(path: Path) -> None:
    """Rows of a recording: a name, times, numbers, flags, lists of texts."""
    import pyarrow as pa
    import pyarrow.parquet

    rng = np.random.default_rng(0)
    times = pa.array(np.arange(ROWS) * 40_000_000).cast(pa.timestamp("ns", "UTC"))
    columns = {
        "recording": pa.array(["a"] * ROWS).dictionary_encode(), "time": times, "P": rng.normal(size=ROWS),
        "q1": rng.normal(size=ROWS).cumsum(), "valid": rng.random(ROWS) > 0.1,
        "flags": [["gap"] if k % 7 == 0 else [] for k in range(ROWS)],
    }  # fmt: skip
    pyarrow.parquet.write_table(pa.table(columns), path)


def damaged(good: bytes, rng: random.Random) -> bytes:
    """A copy with one kind of damage."""
    copy, kind = bytearray(good), rng.randrange(4)
    if kind == 0:
        return bytes(copy[: rng.randrange(len(copy))])
    if kind == 1:
        start = rng.randrange(len(copy))
        del copy[start : start + rng.randint(1, 50)]
        return bytes(copy)
    first = 0 if kind == 2 else len(copy) - FOOTER_BYTES
    for _ in range(rng.randint(1, 4)):
        copy[rng.randrange(first, len(copy))] = rng.randrange(256)
    return bytes(copy)


def outcome(read: Callable[[str], Any], path: Path) -> str:
    """Read, error or panic."""
    try:
        read(str(path))
    except Exception:
        return "error"
    except BaseException as error:  # a panic of Rust is no Exception
        if isinstance(error, KeyboardInterrupt):
            raise
        return "panic"
    return "read"


def judge(library: str, files: int, path: Path) -> None:
    """Print after every file the outcomes of all files so far: the library may end the process."""
    module = import_module(library)
    if library == "arro3.io":

        def read(name: str) -> Any:
            return module.read_parquet(name).read_all()
    else:

        def read(name: str) -> Any:
            return module.ParquetFile(name).read()

    good, rng, counts = path.read_bytes(), random.Random(1), Counter[str]()
    for _ in range(files):
        path.write_bytes(damaged(good, rng))
        counts[outcome(read, path)] += 1
        print(dict(counts), flush=True)


def main() -> None:
    """Print one line per library."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=1500)
    parser.add_argument("--judge", nargs=2, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.judge:
        judge(chosen.judge[0], chosen.files, Path(chosen.judge[1]))
        return
    with tempfile.TemporaryDirectory() as name:
        for library in ("arro3.io", "pyarrow.parquet"):
            path = Path(name) / "rows.parquet"
            good_file(path)
            words = [sys.executable, __file__, "--files", str(chosen.files), "--judge", library, str(path)]
            done = subprocess.run(words, capture_output=True, text=True, check=False)
            lines = done.stdout.splitlines()
            end = (
                f"; file {len(lines) + 1} ended the process (signal {-done.returncode})" if done.returncode < 0 else ""
            )
            print(f"{library}: {len(lines)} files, {lines[-1] if lines else ''}{end}", flush=True)


if __name__ == "__main__":
    main()
