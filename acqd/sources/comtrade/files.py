"""The parts of a COMTRADE recording: a CFG with a DAT, or both in a CFF."""

from __future__ import annotations

import mmap
import re
from itertools import zip_longest
from pathlib import Path

from acqd.errors import InputError
from acqd.sources.text_file import decode

_PART = re.compile(
    rb"^(?:\xef\xbb\xbf)?-{2,}\s*file\s*type\s*:?\s*([a-z]+)[^\n]*?(?::?\s*(?<![\w])(\d+)\s*)?-{2,}[^\n]*\n",
    re.IGNORECASE | re.MULTILINE,
)
"""A line such as `--- file type: DAT BINARY: 1234 ---`; some recorders write it without the colons."""


def parts(path: Path, encoding: str | None) -> tuple[str, bytes | memoryview]:
    """Text of the header, and the data as they are. Raises InputError."""
    if path.suffix.lower() == ".cff":
        return _combined(path, encoding)
    header, data = _sibling(path, ".cfg"), _sibling(path, ".dat")
    return decode(header, header.read_bytes(), encoding), _mapped(data)


def _combined(path: Path, encoding: str | None) -> tuple[str, memoryview]:
    content = _mapped(path)
    text: str | None = None
    found = list(_PART.finditer(content))
    for part, after in zip_longest(found, found[1:]):
        end = after.start() if after else len(content)
        if part.group(1).upper() == b"CFG":
            text = decode(path, bytes(content[part.end() : end]), encoding)
        elif part.group(1).upper() == b"DAT":
            if text is None:
                break
            size = int(part.group(2)) if part.group(2) else end - part.end()
            return text, content[part.end() : part.end() + size]
    raise InputError(path, "lacks a CFG and a DAT part ('--- file type: CFG ---'); is it a COMTRADE CFF file?")


def _mapped(path: Path) -> memoryview:
    """The content, as pages of the file: what is not read takes no memory."""
    with path.open("rb") as file:
        if not path.stat().st_size:
            raise InputError(path, "is empty")
        return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))


def _sibling(path: Path, suffix: str) -> Path:
    """The other file of the pair, in whichever case it is written."""
    if path.suffix.lower() == suffix:
        return path
    for candidate in (path.with_suffix(suffix), path.with_suffix(suffix.upper()), path.with_suffix(suffix.title())):
        if candidate.exists():
            return candidate
    raise InputError(path, f"lacks its {suffix} file next to it")
