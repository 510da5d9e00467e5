"""What later recordings have changed in the belief about the same change."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import orjson

from acqd.report.digits import percent

_SHOWN = 3


def changed_belief(earlier: Path, now: dict[str, Any]) -> list[str]:
    """Two sentences: the belief of an earlier report on the same recordings, and that of `now` (report.json).

    Empty where `earlier` is not a report on the same recordings.
    """
    try:
        before = orjson.loads((earlier / "report.json").read_bytes())
        same = before["asked"]["dataset"] == now["asked"]["dataset"] and not before["asked"]["with"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    if not same:
        return []
    return [f"without the later recordings: {belief(before)}", f"with the later recordings: {belief(now)}"]


def belief(report: dict[str, Any]) -> str:
    """A verdict in a line: the names with their confidence, or the leading hypotheses with their evidence."""
    names = [f"{each['id']} ({each['where']}) {percent(each['confidence'])}" for each in report["effects"]]
    rows = [
        f"{row['id'] or row['where']} {row['evidence']:.0f}" for row in report["hypotheses"][:_SHOWN]
        if row["evidence"] > 0
    ]  # fmt: skip
    verdict = report["verdict"].replace("_", " ")
    if names:
        return f"{verdict}: {', '.join(names)}"
    return f"{verdict}; evidence of {', '.join(rows)}" if rows else verdict
