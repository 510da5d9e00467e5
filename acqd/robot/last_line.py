"""A last line without an end: whole, as many programs write it, or cut off, as by a recorder that was stopped hard.

A line that is cut off has fewer cells, or a last number with fewer digits than any other row: "12.3" of "12.345". A cut
that leaves more digits hardly changes the number.
"""

from __future__ import annotations

from collections.abc import Sequence

CUT_OFF = "its last line is cut off: was the recorder stopped hard, or does it still write?"
LEFT_OUT = f"{CUT_OFF} That line is left out"
_FIXED, _VARYING = 10, 100
"""Other rows from which on their last cells tell: where all have the same number of digits, and where not."""
MOST_ROWS = 1000
"""Other rows that are looked at."""


def is_cut_off(cells: Sequence[str], others: Sequence[Sequence[str]]) -> bool:
    """Whether the `cells` of the last line are a part of a line, by whole lines before it."""
    if not others or not cells:
        return False
    widths = [len(row) for row in others]
    usual = max(set(widths), key=widths.count)
    if len(cells) < usual:
        return True
    before = [row[-1] for row in others if len(row) == usual]
    last = cells[-1]
    if _is_text(before):
        return last not in before and any(cell.startswith(last) for cell in before)
    point = any("." in cell for cell in before)
    lengths = [_length(cell, point=point) for cell in before]
    enough = _FIXED if len(set(lengths)) == 1 else _VARYING
    return len(before) >= enough and _length(last, point=point) < min(lengths)


def _is_text(cells: Sequence[str]) -> bool:
    """Whether most cells begin with a letter."""
    return sum(cell[:1].isalpha() and cell.lower() not in ("nan", "inf") for cell in cells) > len(cells) / 2


def _length(cell: str, *, point: bool) -> int:
    """Characters behind the point (an exponent, too), or digits where no row has a `point`; -1 for an empty cell."""
    if not cell.strip("+-"):
        return -1
    return len(cell.partition(".")[2]) if point else len(cell.lstrip("+-"))
