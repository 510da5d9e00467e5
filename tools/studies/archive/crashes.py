"""Kills a daemon that keeps its samples, takes its power away, and looks what is missing.

    python -m tools.studies.archive.crashes [--rounds 20] [--seed 1] [--json]

Every second round is a SIGKILL, the others are power failures: SIGKILL, and then the file that was being written loses
bytes that the disk had not confirmed: all of them, a random part, or their content (zeros). The daemon says what was
confirmed in a log of its own (`confirming`). All rounds write to one archive. The rows of every round, which a tape
has recorded, are compared with those made of the archive.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from acqd.archive.catalogue import contents
from acqd.archive.repair import repair
from acqd.archive.verify import verified
from acqd.daemon.archive.compare import Comparison
from acqd.daemon.archive.replay import remade
from acqd.daemon.archive.rows import remake
from acqd.telemetry.row import PowerRow, parse_row
from acqd.timestamps import utc_ns

_CONFIG = """
device = "box"
state_dir = "{folder}"
[mqtt]
enabled = false
[health]
port = 0
[archive]
enabled = true
keep_free_gb = 0.0
[source]
kind = "simulated"
seed = 3
"""


def crashes(
    rounds: Annotated[int, typer.Option(min=2, help="Ends of the daemon.")] = 20,
    seed: Annotated[int, typer.Option(help="Of the moments and of what the power takes.")] = 1,
    json_: Annotated[bool, typer.Option("--json", help="Machine-readable output.")] = False,
) -> None:
    """Kill, cut, compare; exit code 1 where more than a second is missing, a gap has no name, or a row differs."""
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "acqd.toml").write_text(_CONFIG.format(folder=folder))
        missing_s = [_round(folder, number, rng) for number in range(rounds)]
        figures = _judged(folder, rounds) | {"missing_s": [round(each, 3) for each in missing_s]}
    figures["worst_missing_s"] = max(figures["missing_s"])
    figures["simulated"] = True
    print(json.dumps(figures) if json_ else "\n".join(f"{key}: {value}" for key, value in figures.items()))
    good = figures["worst_missing_s"] <= 1.0 and figures["named_gaps"] == rounds - 1
    good &= not (figures["different"] or figures["damaged"] or figures["other_gaps"])
    sys.exit(0 if good else 1)


def _round(folder: Path, number: int, rng: random.Random) -> float:
    """One life and death; how much less than the tape the archive has [s]."""
    tape, log = folder / f"tape-{number}.jsonl", folder / f"confirmed-{number}.jsonl"
    command = [sys.executable, "-m", "tools.studies.archive.confirming", str(log), "run", "--config"]
    command += [str(folder / "acqd.toml"), "--tape", str(tape)]
    said = folder / f"log-{number}.txt"
    with said.open("wb") as file:
        daemon = subprocess.Popen(command, stdout=file, stderr=file, start_new_session=True)
    while not tape.exists() or tape.stat().st_size < 200_000:  # some seconds of rows
        time.sleep(0.05)
        if daemon.poll() is not None:
            raise SystemExit(f"the daemon ended by itself with {daemon.returncode}: {said.read_text()[-1000:]}")
    time.sleep(rng.uniform(0.0, 1.5))
    os.kill(daemon.pid, signal.SIGKILL)
    daemon.wait()
    newest = max((folder / "archive-box" / "box").glob("*.arc"))
    if number % 2:
        _cut_power(newest, log, rng)
    segment = repair(newest)
    assert segment is not None
    rows = _rows(tape)
    return max(0.0, (utc_ns(rows[-1].filetime) + 40_000_000 - segment.end_ns) / 1e9)


def _cut_power(path: Path, log: Path, rng: random.Random) -> None:
    """Take away what the disk had not confirmed, or a part of it."""
    confirmed = max((each["size"] for each in map(json.loads, log.open()) if each["file"] == path.name), default=0)
    size = path.stat().st_size
    kept = rng.choice((confirmed, rng.randint(confirmed, size), rng.randint(confirmed, size)))
    data = path.read_bytes()[:kept]
    if rng.random() < 0.5:
        data += bytes(size - kept)  # the length was on disk, the content was not
    path.write_bytes(data)


def _judged(folder: Path, rounds: int) -> dict[str, Any]:
    there = contents(folder / "archive-box")
    stored = [row for number in range(rounds) for row in _rows(folder / f"tape-{number}.jsonl")]
    comparison = Comparison.of(stored)
    report = remade(there, None, None, lambda tasks: map(remake, tasks), None, comparison)
    gaps = there.gaps()
    named = [gap for gap in gaps if gap.samples is None and "killed, crashed, or without power" in gap.why]
    return {
        "rounds": rounds,
        "segments": len(there.segments),
        "seconds": round(report.recorded_s, 1),
        "rows": report.rows,
        "same": comparison.same,
        "different": comparison.different,
        "not_on_tape": comparison.not_stored,
        "not_in_archive": comparison.not_archived,
        "named_gaps": len(named),
        "other_gaps": [gap.why for gap in gaps if gap not in named],
        "damaged": [fault for segment in there.segments for fault in verified(segment).faults],
    }


def _rows(tape: Path) -> list[PowerRow]:
    return [parse_row(line) for line in tape.read_bytes().splitlines(keepends=True) if line.endswith(b"\n")]


if __name__ == "__main__":
    typer.run(crashes)
