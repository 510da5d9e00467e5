"""Mutations of valid input: bytes, numbers, cells, lines; reproducible from a seed."""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Callable
from typing import TypeAlias

Files: TypeAlias = dict[str, bytes]
"""One input: the contents of a file, or of the files that belong together, by name."""

_NUMBERS = (
    "0", "-0", "1", "-1", "nan", "inf", "-inf", "1e308", "-1e308", "1e309", "1e-320", "9e18", "9223372036854775807",
    "9223372036854775808", "-9223372036854775809", "18446744073709551616", "65536", "2147483648", "0.1", "1e999999",
    "null", "true", "[]", "{}", '""', "'", '"', "1_0", "0x10", "01", "+5", " ", "", "\u0661", "1,5", "--1", "9" * 5000,
)  # fmt: skip
_SPECKS = (
    b"\x00", b"\xff", b"\n", b"\r", b"\r\n", b",", b";", b"\t", b'"', b"\\", b"[", b"{" * 60, b"[" * 2000, b"%", b"=",
    b"\xef\xbb\xbf", b"\xc3\x28", b"\xed\xa0\x80", b"\\u0000", b"\x1a", b"#", b"/", b"..", b"\xe2\x80\xa8",
)  # fmt: skip
_WIDTHS = ("<h", "<i", "<q", "<d", ">h", ">i", ">q", "<f")
_WORD_ENDS = re.compile(rb'[ ,;\t\n\r:=[\]{}"]')
_EXTREMES = (0, 1, -1, 2**15 - 1, -(2**15), 2**31 - 1, -(2**31), 2**63 - 1, -(2**63))


def mutated(files: Files, others: list[Files], chance: random.Random) -> Files:
    """`files` with one to a few mutations in one of them, sometimes spliced with another seed."""
    name = chance.choice(sorted(files))
    content = files[name]
    for _ in range(chance.choice((1, 1, 1, 2, 3, 6))):
        if chance.random() < 0.05:
            content = _spliced(content, chance.choice(others).get(name, content), chance)
        else:
            content = chance.choice(_MUTATIONS)(content, chance)
    return {**files, name: content[:200_000]}


def _spliced(one: bytes, other: bytes, chance: random.Random) -> bytes:
    return one[: chance.randint(0, len(one))] + other[chance.randint(0, len(other)) :]


def _flip(content: bytes, chance: random.Random) -> bytes:
    if not content:
        return b"\x00"
    changed = bytearray(content)
    for _ in range(chance.choice((1, 1, 2, 8))):
        changed[chance.randrange(len(changed))] = chance.randrange(256)
    return bytes(changed)


def _cut_off(content: bytes, chance: random.Random) -> bytes:
    return content[: chance.randint(0, len(content))]


def _removed(content: bytes, chance: random.Random) -> bytes:
    start = chance.randint(0, len(content))
    return content[:start] + content[start + chance.choice((1, 2, 4, 16, 200)) :]


def _repeated(content: bytes, chance: random.Random) -> bytes:
    start = chance.randint(0, len(content))
    part = content[start : start + chance.choice((1, 4, 40, 400))]
    return content[:start] + part * chance.choice((2, 3, 50)) + content[start:]


def _inserted(content: bytes, chance: random.Random) -> bytes:
    at = chance.randint(0, len(content))
    return content[:at] + chance.choice(_SPECKS) + content[at:]


def _binary_number(content: bytes, chance: random.Random) -> bytes:
    width = chance.choice(_WIDTHS)
    size = struct.calcsize(width)
    if len(content) < size:
        return content
    try:
        number = struct.pack(width, chance.choice(_EXTREMES))
    except struct.error:
        number = b"\xff" * size
    at = chance.randint(0, min(len(content) - size, chance.choice((64, 4096, 10**9))))
    return content[:at] + number + content[at + size :]


def _text_number(content: bytes, chance: random.Random) -> bytes:
    """Another value in the place of some number or word."""
    ends = [end.start() for end in _WORD_ENDS.finditer(content, 0, 20_000)]
    if len(ends) < 2:
        return content
    k = chance.randrange(len(ends) - 1)
    word = chance.choice(_NUMBERS).encode()
    return content[: ends[k] + 1] + word + content[ends[k + 1] :]


def _lines(content: bytes, chance: random.Random) -> bytes:
    """A line removed, doubled, moved or emptied."""
    lines = content.split(b"\n")
    k, other = chance.randrange(len(lines)), chance.randrange(len(lines))
    match chance.randrange(4):
        case 0:
            del lines[k]
        case 1:
            lines.insert(other, lines[k])
        case 2:
            lines[k], lines[other] = lines[other], lines[k]
        case _:
            lines[k] = b""
    return b"\n".join(lines)


_MUTATIONS: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    _flip, _flip, _cut_off, _removed, _repeated, _inserted, _inserted, _binary_number, _text_number, _text_number,
    _text_number, _lines,
)  # fmt: skip
