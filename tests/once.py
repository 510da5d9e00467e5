"""Products that take seconds to make: the first test that asks makes them, for all workers of pytest-xdist."""

from __future__ import annotations

import fcntl
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any


class Once:
    """`once(name, make)` returns the folder that `make(folder)` filled, and what it returned.

    Tests look at the product and do not write into it: it is shared.
    """

    def __init__(self, root: Path) -> None:
        self.root = root

    def __call__(self, name: str, make: Callable[[Path], Any]) -> tuple[Path, Any]:
        folder, returned = self.root / name, self.root / f"{name}.pickle"
        with (self.root / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # the other workers wait here
            if not returned.exists():
                shutil.rmtree(folder, ignore_errors=True)  # of an attempt that failed
                folder.mkdir()
                value = make(folder)
                part = self.root / f"{name}.part"
                part.write_bytes(pickle.dumps(value))
                part.rename(returned)
            return folder, pickle.loads(returned.read_bytes())
