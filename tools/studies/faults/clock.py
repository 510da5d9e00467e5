"""A clock that can be set: libfaketime."""

from __future__ import annotations

import os
from pathlib import Path

CACHE_S = 1
"""How long libfaketime may take to notice that the clock was set [s]."""
_LIBRARIES = sorted(Path("/usr/lib").glob("*/faketime/libfaketime.so.1"))


def missing() -> str:
    """Why clocks cannot be set, else empty."""
    return "" if _LIBRARIES else "libfaketime is not installed (apt-get install libfaketime)"


class FakedClock:
    """The clock of a process, some seconds ahead of this computer's."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "clock"
        self.set(0.0)

    def environment(self) -> dict[str, str]:
        """Of the process."""
        return {
            "LD_PRELOAD": str(_LIBRARIES[-1]), "FAKETIME_TIMESTAMP_FILE": str(self._file),
            "FAKETIME_DONT_FAKE_MONOTONIC": "1", "DONT_FAKE_MONOTONIC": "1", "FAKETIME_CACHE_DURATION": str(CACHE_S),
        }  # fmt: skip

    def set(self, seconds: float) -> None:
        """Put the clock so many seconds ahead."""
        new = self._file.with_suffix(".new")
        new.write_text(f"{seconds:+}")
        os.replace(new, self._file)
