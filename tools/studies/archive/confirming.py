"""`acqd` whose archive writes down what the disk has confirmed: what a power failure may not take.

python -m tools.studies.archive.confirming LOG run --config acqd.toml
"""

from __future__ import annotations

import json
import os
import sys

from acqd.archive.segment_file import SegmentFile
from acqd.cli.main import main


def confirming(log: str) -> None:
    """Log the size of every file after each confirmation."""
    handle, whole = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o640), SegmentFile.sync

    def sync(self: SegmentFile) -> None:
        size = self.size
        whole(self)
        os.write(handle, json.dumps({"file": self.path.name, "size": size}).encode() + b"\n")

    SegmentFile.sync = sync  # type: ignore[method-assign]


if __name__ == "__main__":
    confirming(sys.argv[1])
    sys.argv = ["acqd", *sys.argv[2:]]
    main()
