"""Is every log processed exactly once if the sidecar is killed while logs arrive?"""

from __future__ import annotations

import json
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
from tools.studies.sidecar.cell import DEVICE, Cell, Listener


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
    with open_database(str(cell.database), create=False).connect() as connection:
        logs = connection.exec_driver_sql("SELECT sha256, name, status, message FROM prediction_log").all()
        query = "SELECT sha256, count(*) FROM prediction GROUP BY sha256"
        counts: dict[str, int] = {row[0]: row[1] for row in connection.exec_driver_sql(query)}
    wrong = [name for sha256, name, status, text in logs if not _complete(status, text, counts.get(sha256, 0))]
    return {
        "logs": len(sources), "kills": kills, "processed": len({name for _, name, _, _ in logs}),
        "once": len(logs) == len(sources), "refused": sum(status == "refused" for _, _, status, _ in logs),
        "rows_wrong": len(wrong), "published": len(set(published)),
        "published_again": len(published) - len(set(published)),
    }  # fmt: skip


def _feed(sources: list[Path], logs: Path, stop: threading.Event, random_: random.Random, pace_s: float) -> None:
    """Writes logs as robots and file servers do: at once, in pieces, or under another name first."""
    for source in sources:
        if stop.wait(random_.uniform(0, 2 * pace_s)):
            break
        way, target, content = random_.randrange(3), logs / source.name, source.read_bytes()
        if way == 0:
            target.write_bytes(content)
        elif way == 1:
            cut = random_.randrange(len(content))
            target.write_bytes(content[:cut])
            time.sleep(0.2)
            with target.open("ab") as file:
                file.write(content[cut:])
        else:
            part = target.with_suffix(".part")
            part.write_bytes(content)
            part.rename(target)


def _complete(status: str, text: Any, rows: int) -> bool:
    message = text if isinstance(text, dict) else json.loads(text)
    return rows == (message["rows"] if status == "ok" else 0)
