"""Which findings of a report ask no further question. Reads report.json only, so that the core can."""

from __future__ import annotations

from typing import Any

SURE = 0.95
"""Confidence of a name that asks no question; a family is always one."""


def settled(effect: dict[str, Any]) -> bool:
    """Whether an effect of report.json has a name that the loop does not doubt."""
    return bool(effect["confidence"] >= SURE and not effect["family"]["members"])


def leaves_open(report: dict[str, Any]) -> bool:
    """Whether report.json has a question left: no name for what differs, or a name in doubt."""
    nameless = report["verdict"] in ("unknown_structure", "not_identifiable")
    return nameless or not all(map(settled, report["effects"]))
