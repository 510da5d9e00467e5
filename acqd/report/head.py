"""What a page says about itself in a few words, for lists of pages and for links between them.

The page carries the words as JSON near its top, so that a list reads the beginning of a file only.
"""

from __future__ import annotations

import html
import json
import re
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, get_args

from acqd.atomic import require_writable
from acqd.errors import InputError, UserError
from acqd.report.verdict import KeyFigure, Tone, Verdict

_BEGINNING = 65_536
"""Bytes that hold the words; the verdict is a few sentences."""
_END = 64
_MARK = re.compile(rb'<script type="application/json" id="page">(.*?)</script>', re.DOTALL)
_TITLE = re.compile(r"<title>(.*?)</title>", re.DOTALL)
_TILE = re.compile(r'<section class="tile (\w+)"[^>]*><h2 id="verdict">(.*?)</h2>', re.DOTALL)
_WRITTEN = re.compile(r"<dt>written</dt><dd>(.*?)</dd><dt>by</dt><dd>(acqd .*?)</dd>")


@dataclass(frozen=True, slots=True)
class Head:
    """The words."""

    title: str
    kind: str = "page"
    """What the page is: closing report, dataset, fleet ..."""
    subject: str = ""
    """Robot, device or fleet that the page is about."""
    written: str = ""
    """UTC, to the minute."""
    by: str = ""
    """Program and version."""
    simulated: bool = False
    verdict: Verdict = field(default_factory=lambda: Verdict("fine", ""))

    def as_script(self) -> str:
        """The element that carries the words."""
        text = json.dumps(asdict(self), ensure_ascii=False).replace("<", "\\u003c")
        return f'<script type="application/json" id="page">{text}</script>'


def read_head(path: Path) -> Head:
    """The words of a page; of a page of an earlier version, what its text has. Raises InputError."""
    try:
        with path.open("rb") as file:
            beginning = file.read(_BEGINNING)
            size = file.seek(0, 2)
            file.seek(max(size - _END, 0))
            whole = b"</html>" in file.read()
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None
    mark = _MARK.search(beginning)
    head = _of_json(path, mark.group(1)) if mark else _of_text(path)
    if not whole:
        raise InputError(path, "is cut off: the end of the page is missing; write the report again")
    return head


def require_kind(path: Path, kind: str) -> None:
    """Raises UserError unless a page of this kind may be written: nothing is there, or an earlier one of its kind."""
    require_writable(path)
    if not path.is_file() or not path.stat().st_size:
        return
    try:
        earlier = read_head(path).kind
    except InputError:
        earlier = ""
    if earlier not in (kind, "page"):  # "page": of an earlier version
        raise UserError(
            f"{path} exists and is no earlier page of the kind {kind}: it would be lost; choose another name"
        )


def _of_json(path: Path, text: bytes) -> Head:
    try:
        told: dict[str, Any] = json.loads(text)
        said = told.pop("verdict")
        figures = [KeyFigure(**each) for each in said.pop("figures")]
        head = Head(**told, verdict=Verdict(**said, figures=figures))
        words = (head.title, head.kind, head.subject, head.written, head.by, head.verdict.headline)
        if head.verdict.tone not in get_args(Tone) or not all(isinstance(each, str) for each in words):
            raise ValueError("not the words of a page")
        return head
    except (ValueError, TypeError, KeyError, AttributeError):
        raise InputError(path, "has a head that this version of acqd does not read") from None


def _of_text(path: Path) -> Head:
    """A page from before pages had a head. Raises InputError for what is no page of acqd."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise InputError(path, "is no page of acqd") from None
    written, title = _WRITTEN.search(text), _TITLE.search(text)
    if written is None or title is None:
        raise InputError(path, "is no page of acqd")
    tile = _TILE.search(text)
    tone: Tone = next((tone for tone in get_args(Tone) if tile and tile.group(1) == tone), "open")
    verdict = Verdict(tone, html.unescape(tile.group(2)) if tile else "")
    simulated = '<span class="label">simulated data</span>' in text
    name = html.unescape(title.group(1))
    return Head(name, written=written.group(1), by=written.group(2), simulated=simulated, verdict=verdict)
