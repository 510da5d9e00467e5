"""Text of recordings: UTF-8, else Latin-1, unless the user says which encoding."""

from __future__ import annotations

import codecs
from pathlib import Path

from acqd.errors import InputError, UserError

_HEAD = 64 * 1024  # bytes that show the encoding of a table
_FOREIGN = 0.1  # share of bytes that letters beyond ASCII have in a table in Latin-1


def check_encoding(name: str, option: str = "--encoding") -> str:
    """`name` if Python knows this text encoding. Raises UserError, which names `option`."""
    try:
        "".encode(name)  # refuses what is no text encoding, such as base64
    except (LookupError, ValueError):
        raise UserError(f"{option}: {name!r} is no text encoding; expected one like utf-8, latin-1, cp1250") from None
    return name


_UTF16 = (b"\xff\xfe", b"\xfe\xff")
"""How texts begin that Windows saves as "Unicode"."""


def encoding_of(path: Path) -> str:
    """The encoding of a table, from its first 64 KiB: UTF-8, or Latin-1 where a few letters are.

    Raises InputError for binary data.
    """
    with path.open("rb") as file:
        head = file.read(_HEAD)
    if head.startswith(_UTF16):
        return "utf-16"
    _refuse_binary(path, head)
    if _is_utf8(head):
        return "utf-8-sig"
    foreign = sum(byte > 0x7F for byte in head)
    if foreign > _FOREIGN * len(head) or any(byte < 0x20 and byte not in b"\t\r\n\f\x1a" for byte in head):
        raise InputError(path, "is not text; expected a header row and numbers, or give its encoding with --encoding")
    return "latin-1"


def _is_utf8(content: bytes) -> bool:
    try:
        codecs.getincrementaldecoder("utf-8-sig")().decode(content)
    except UnicodeDecodeError:
        return False
    return True


def decode(path: Path, content: bytes, encoding: str | None) -> str:
    """The text in `content`. Raises InputError for bytes that `encoding` does not have, and for binary data."""
    if encoding is not None:
        try:
            return content.decode(encoding)
        except UnicodeError:
            raise InputError(path, f"is not text in {encoding}; give its encoding with --encoding") from None
    if content.startswith(_UTF16):
        return content.decode("utf-16", errors="replace")
    _refuse_binary(path, content)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _refuse_binary(path: Path, content: bytes) -> None:
    if b"\0" in content.rstrip(b"\0"):  # at the end: blocks that a logger had reserved
        raise InputError(path, "is not text; if it is UTF-16, say so with --encoding utf-16")
