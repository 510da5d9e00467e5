"""Is every log processed exactly once if the sidecar is killed while logs arrive?"""

from __future__ import annotations

import random
import signal
import subprocess
import threading
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

from acqd.errors import OperationError
from acqd.storage.database import open_database
from tools.studies.sidecar.arrival import arrive
from tools.studies.sidecar.cell import DEVICE, Cell, Listener
from tools.studies.sidecar.judge import done_logs


def killed(cell: Cell, sources: list[Path], kills: int, seed: int) -> dict[str, Any]:
    """Kills the sidecar (SIGKILL) again and again while logs arrive; counts in the database and on the broker."""
    random_, stop = random.Random(seed), threading.Event()
    pace_s = 3.0 * kills / len(sources)
    with Listener(cell.port, f"acqd/{DEVICE}/prediction") as listener:
        feeder = threading.Thread(target=_feed, args=(sources, cell.logs, stop, random.Random(seed + 1), pace_s))
        feeder.start()
        for _ in track(range(kills), "killing", console=Console(stderr=True)):
            process = cell.start()
            time.sleep(random_.uniform(1.0, 5.0))
            process.send_signal(signal.SIGKILL)
            process.wait()
        feeder.join()
        last = subprocess.run(cell.command("--until-idle"), capture_output=True, text=True, check=False)
        if last.returncode:
            raise OperationError(f"the last start failed: {last.stderr}")
        published = [message["sha256"] for _, message in listener.messages]
    logs = done_logs(open_database(str(cell.database), create=False))
    return {
        "logs": len(sources), "kills": kills, "processed": len({log.name for log in logs}),
        "once": len(logs) == len(sources), "refused": sum(log.status == "refused" for log in logs),
        "rows_wrong": sum(not log.complete for log in logs), "published": len(set(published)),
        "published_again": len(published) - len(set(published)),
    }  # fmt: skip


def _feed(sources: list[Path], logs: Path, stop: threading.Event, random_: random.Random, pace_s: float) -> None:
    for source in sources:
        if stop.wait(random_.uniform(0, 2 * pace_s)):
            break
        arrive(source, logs, random_)
