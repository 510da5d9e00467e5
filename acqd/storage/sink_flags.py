"""Flags that the sink adds to rows: a row that comes again without them is the same row."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from acqd.storage import boot_watch, clock_witness

FLAGS = frozenset({clock_witness.FLAG, boot_watch.FLAG})


def added(flags: Iterable[str]) -> bool:
    """Whether the sink has added one."""
    return not FLAGS.isdisjoint(flags)


def same_row(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two rows are equal but for such flags."""
    if one == other:
        return True
    plain = [{**row, "flags": [name for name in row.get("flags", ()) if name not in FLAGS]} for row in (one, other)]
    return plain[0] == plain[1]
