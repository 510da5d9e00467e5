"""Results of visitors' files are bounded: beyond a number or a size the oldest ones are removed."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Iterator
from pathlib import Path

from acqd.web.reports import OF_FILES

_log = logging.getLogger(__name__)


def remove_oldest(reports: Path, most: int, most_bytes: float) -> list[str]:
    """Remove folders `files-TIME` beyond `most` of them or beyond `most_bytes` in all, the oldest first.

    The newest one always stays. Returns the names of those that are gone; a folder that cannot be removed is logged.
    """
    found = sorted(path for path in _listed(reports) if OF_FILES.fullmatch(path.name) and not path.is_symlink())
    sizes = [sum(_sizes(path)) for path in found]
    gone = []
    for k, path in enumerate(found[:-1]):
        if len(found) - k <= most and sum(sizes[k:]) <= most_bytes:
            break
        shutil.rmtree(path, ignore_errors=True)
        if path.exists():
            _log.warning("%s: cannot be removed; may the page write there?", path)
        else:
            gone.append(path.name)
    if gone:
        _log.info(
            "results of visitors: the oldest %d removed, %s ([web] files_kept, files_kept_MB)", len(gone), gone[-1]
        )
    return gone


def _listed(folder: Path) -> Iterator[Path]:
    try:
        yield from folder.iterdir()
    except OSError:
        return


def _sizes(folder: Path) -> Iterator[int]:
    for path in folder.rglob("*"):
        try:
            yield path.lstat().st_size
        except OSError:  # removed meanwhile
            continue
