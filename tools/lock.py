"""The packages of a report of pip, each with the hash of the file that was installed: python -m tools.lock REPORT.

pip install --require-hashes -r requirements.lock && pip install --no-deps .
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any


def locked(report: dict[str, Any]) -> list[str]:
    """Lines of a requirements file, sorted; the project itself, which is a folder, is left out."""
    lines = []
    for package in report["install"]:
        hashes = package["download_info"].get("archive_info", {}).get("hashes", {})
        if "sha256" in hashes:
            about = package["metadata"]
            lines.append(f"{about['name'].lower()}=={about['version']} --hash=sha256:{hashes['sha256']}")
    return sorted(lines)


if __name__ == "__main__":
    print("\n".join(locked(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))))
