"""Faults of paths: what is behind a name is moved, copied, cut off, mounted over, put back, or may not grow."""

from __future__ import annotations

import os
import random
import resource
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

from tools.studies.faults.bed import Bed
from tools.studies.faults.fault import Begin, Fault, lasting, pause
from tools.studies.faults.on_storage import wait_for_one_segment

_SMALL = 512 << 10
"""Bytes of a file at most: less than a segment or the database; more than compiled modules, of which Python would write
a part."""

_WAITS_S = 60.0


def spool_moved(bed: Bed, chance: random.Random) -> None:
    """Somebody moves the spool's folder elsewhere while no closed file waits; a moment later the broker is away."""
    if not wait_for_one_segment(bed):
        return
    for folder in bed.state_dir.glob("spool-*"):
        if not folder.is_symlink():
            folder.rename(bed.state_dir / f"elsewhere-{chance.randrange(1 << 30)}")
    proxy = bed.proxies["daemon"]
    proxy.mode = "silent"
    pause(chance, 1.0, 4.0)
    proxy.mode = "pass"


def mounted_over(place: str) -> Begin:
    """An empty file system is mounted over a folder in use, as a share that comes late, and goes away again."""

    def begin(bed: Bed, fault: ExitStack) -> None:
        folder = str(bed.folder / place)
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "none", folder], check=True)
        fault.callback(subprocess.run, ["umount", "--lazy", folder], check=True)

    return begin


def files_limited(bed: Bed, fault: ExitStack) -> None:
    """No file of the sink may grow beyond half a megabyte (`ulimit -f`, LimitFSIZE).

    Not of the daemon: the tape would lack rows.
    """
    for pid in bed.sink.family():
        before = resource.prlimit(pid, resource.RLIMIT_FSIZE, (_SMALL, resource.RLIM_INFINITY))
        fault.callback(_set_limit, pid, before)


def computer_put_back(bed: Bed, chance: random.Random) -> None:
    """The sink's computer is put back to a snapshot of some seconds before: database, and all that the sink knows."""
    services = [bed.sink] if bed.sidecar is None else [bed.sink, bed.sidecar]
    for action in (_copy, _put_back):
        _wait_for_rows(bed)
        pause(chance, 1.0, 3.0)
        for service in services:
            service.stop()
        bed.engine.dispose()
        action(bed)
        for service in services:
            service.start()


def log_cut_off(bed: Bed, chance: random.Random) -> None:
    """Somebody cuts off the write-ahead log of the file, all or a part of it, as a rotation of logs that truncates."""
    _wait_for_rows(bed)
    bed.engine.dispose()  # whoever has the file open keeps what SQLite believes of the log
    log = Path(f"{bed.engine.url.database}-wal")
    with suppress(FileNotFoundError):
        os.truncate(log, int(log.stat().st_size * chance.choice([0.0, 0.5, 0.9])))
    pause(chance, 1.0, 4.0)
    if bed.sidecar is not None:  # it looks which logs are done when it starts
        bed.sidecar.stop()
        bed.sidecar.start()


def segments_copied(bed: Bed, chance: random.Random) -> None:
    """Rows wait in a file that somebody copies or links to later numbers, and the daemon is killed."""
    proxy = bed.proxies["daemon"]
    proxy.mode = "refuse"
    proxy.reset()
    pause(chance, 1.0, 3.0)
    found = [path for path in sorted(bed.folder.rglob("spool-*/*.seg")) if path.stem.isdigit()]
    for path in found[-1:]:
        for more in (2, 3):
            later = path.with_name(f"{int(path.stem) + more:016d}.seg")
            if chance.random() < 0.5:
                shutil.copy(path, later)
            else:
                os.link(path, later)
    bed.daemon.kill()
    bed.daemon.start()
    proxy.mode = "pass"


def _wait_for_rows(bed: Bed) -> None:
    """Until the sink stores rows: a start takes a while on a busy computer."""
    offset, deadline = bed.taped(), time.monotonic() + _WAITS_S
    while not bed.arrived(offset) and time.monotonic() < deadline:
        time.sleep(0.1)


def _files(bed: Bed) -> Iterator[Path]:
    """Of the sink's computer, now."""
    yield from (file for file in (bed.folder / "database").iterdir() if file.is_file())
    yield from bed.state_dir.glob("sink-*.json")


def _copy(bed: Bed) -> None:
    snapshot = bed.folder / "snapshot"
    shutil.rmtree(snapshot, ignore_errors=True)
    for file in _files(bed):
        copy = snapshot / file.relative_to(bed.folder)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, copy)


def _put_back(bed: Bed) -> None:
    for file in list(_files(bed)):
        file.unlink()
    shutil.copytree(bed.folder / "snapshot", bed.folder, dirs_exist_ok=True)


def _set_limit(pid: int, limit: tuple[int, int]) -> None:
    try:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, limit)
    except ProcessLookupError:
        return


FAULTS: dict[str, Fault] = {
    "spool moved": spool_moved,
    "mounted over the spool": lasting(mounted_over("state")),
    "mounted over the database": lasting(mounted_over("database")),
    "sink's files limited": lasting(files_limited),
    "sink's computer put back": computer_put_back,
    "database's log cut off": log_cut_off,
    "segments copied": segments_copied,
}
