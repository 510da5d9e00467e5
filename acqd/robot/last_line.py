"""A last line without an end: whole, as many programs write it, or cut off, as by a recorder that was stopped hard.

A line that is cut off lacks cells, or digits of its last number: "12.3" of "12.345". A writer that pads numbers with
zeros ("12.300") shows how many digits a whole number has; one that leaves zeros out does so in one of ten numbers. Of
integers, texts and empty cells, nothing shows the end; and a cut that leaves more digits hardly changes the number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

CUT_OFF = "its last line is cut off: was the recorder stopped hard, or does it still write?"
LEFT_OUT = f"{CUT_OFF} That line is left out"
MOST_ROWS = 1000
"""Other rows that are looked at."""
_FEWEST, _FEWEST_UNPADDED = 10, 50
"""Numbers that tell how a column is written: where a padding zero is among them, and where not (0.9^50 is 1 in 200)."""
_FIXED = re.compile(r"[+-]?\d*\.(?P<decimals>\d+)(?P<exponent>[eE][+-]?\d+)?")
_BEGUN = re.compile(r"[+-]|[+-]?\d*(?:\.(?P<rest>\d*(?:[eE][+-]?\d*)?))?")
"""Any beginning of such a number."""
_SPECIAL = re.compile(r"[+-]?[01]?")
"""Nothing, or 0 and 1 without decimals: programs write missing values, and the ends of a scale, so."""
_NO_NUMBER = ("", "nan", "inf", "null", "none", "na", "n/a")


def lacks_cells(cells: Sequence[str], others: Sequence[Sequence[str]]) -> bool:
    """Whether the last line has fewer `cells` than any whole line before it, or bytes that no text has."""
    return bool(others) and (len(cells) < min(len(row) for row in others) or any("\0" in cell for cell in cells))


def lacks_digits(cells: Sequence[str], others: Sequence[Sequence[str]]) -> bool:
    """Whether the last of the `cells` is the beginning of a number that the lines before write with more digits."""
    last = cells[-1] if cells else ""
    begun = _BEGUN.fullmatch(last)
    if begun is None or (_SPECIAL.fullmatch(last) and last not in ("+", "-")):
        return False
    before = [row[-1] for row in others if len(row) == len(cells)]
    numbers = [_FIXED.fullmatch(cell) for cell in before if cell.strip("+-").lower() not in _NO_NUMBER]
    fixed = [number for number in numbers if number is not None]
    padded = any(number["decimals"].endswith("0") for number in fixed)
    if len(fixed) < max(_FEWEST if padded else _FEWEST_UNPADDED, len(numbers)) or not (padded or begun["rest"]):
        return False
    lengths = {len(number["decimals"] + (number["exponent"] or "")) for number in fixed}
    return len(lengths) == 1 and len(begun["rest"] or "") < lengths.pop()


def is_cut_off(cells: Sequence[str], others: Sequence[Sequence[str]]) -> bool:
    """Whether the `cells` of the last line are a part of a line, by whole lines before it."""
    return lacks_cells(cells, others) or lacks_digits(cells, others)
