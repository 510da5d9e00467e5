"""Whole numbers in texts of others."""

from __future__ import annotations


def whole_number(text: str, digits: int = 9) -> int | None:
    """A number of at most so many digits 0 to 9, else None.

    `str.isdigit` takes a superscript two, too, which `int` refuses, as it does a number of more than 4300 digits.
    """
    return int(text) if text.isascii() and text.isdigit() and len(text) <= digits else None
