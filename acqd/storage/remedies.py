"""What SQLite says of a file that cannot be used, and what a person can do about it."""

from __future__ import annotations

_REMEDIES = (
    ("database is locked", "another program writes into it (fuser FILE): end that, or try again"),
    ("database disk image is malformed", "the file is damaged: acqd service restore, or another copy"),
    ("file is not a database", "is it another program's file?"),
    ("attempt to write a readonly database", "this user may not write it: sudo, or change its owner"),
    ("unable to open database file", "may this user read and write the file and its folder? sudo, or change its owner"),
    ("database or disk is full", "make room on its disk"),
)


def remedy(reason: str) -> str | None:
    """For what SQLite says; None where nothing in particular helps."""
    return next((words for start, words in _REMEDIES if reason.startswith(start)), None)
