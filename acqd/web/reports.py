"""The newest report of the loop in a folder."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from acqd.report.joint_names import all_with_joint_names

REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; sandbox allow-scripts"
)
"""A report is one self-contained file. The sandbox keeps its script away from the page's cookie and requests."""
OF_FILES = re.compile(r"files-\d{8}T\d{6}Z")
"""Name of a folder with what became of a visitor's files."""
_KEYS = (
    "verdict", "before", "after", "effects", "correction", "unexplained", "next", "measured", "recordings", "model",
    "dataset",
)  # fmt: skip


def newest_report(folder: Path | None) -> Path | None:
    """Folder of the newest result: `folder` itself, or one or two levels below."""
    if folder is None or not folder.is_dir():
        return None
    pages = [path for depth in ("", "*/", "*/*/") for path in folder.glob(f"{depth}report.html")]
    found = [path for path in pages if _is_of_loop(path, folder)]
    newest = max(found, key=lambda path: path.stat().st_mtime, default=None)
    return newest.parent if newest is not None else None


def _is_of_loop(page: Path, folder: Path) -> bool:
    """Whether a page is no report of a dataset, of a visitor's files, or of a search at work in a hidden folder."""
    other = any(part.startswith(".") or OF_FILES.fullmatch(part) for part in page.relative_to(folder).parts)
    return not other and not (page.parent / "manifest.json").exists()


def summary(report: Path) -> dict[str, Any]:
    """What the page shows of a result; `name` and `written` (Unix s) when its report.json cannot be read."""
    shown = {"name": report.name, "written": (report / "report.html").stat().st_mtime}
    try:
        content = json.loads((report / "report.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return shown
    if not isinstance(content, dict):
        return shown
    named = all_with_joint_names(content, content.get("joint_names", ()))
    return shown | {key: named[key] for key in _KEYS if key in named}
