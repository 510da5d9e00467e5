"""Links between pages: a page names the pages that it was made from, and these name the page.

A page is written before the pages that will follow from it. Every page therefore holds a place for links, and the later
page fills the place of the earlier one. Links are relative: a folder of pages can be moved as a whole.
"""

from __future__ import annotations

import html
import os
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Literal
from urllib.parse import quote, unquote

from acqd.atomic import write_complete
from acqd.errors import InputError, OperationError
from acqd.report.head import read_head

REPORT = "report.html"
"""Name of the page in a folder of results."""
EMPTY = "<!--pages--><!--/pages-->"
"""The place for links of a page that has none."""
_PLACE = re.compile(r"<!--pages-->(.*?)<!--/pages-->", re.DOTALL)
_LINK = re.compile(r'<a data-way="(earlier|later)" href="([^"]*)">(.*?)</a>')
_EARLIER = {
    "dataset": ("campaign", "laboratory", "dataset"),
    "models": ("dataset",),
    "closing report": ("dataset", "models", "closing report"),
    "next": ("closing report",),
    "energy": ("dataset", "models", "closing report"),
    "saving": ("models", "closing report"),
    "ability": ("models", "closing report"),
    "fleet": ("dataset", "closing report"),
    "plant": ("fleet",),
    "month": ("fleet",),
    "trial": ("campaign", "dataset", "closing report", "next"),
}
"""Kinds of pages that a page is made from; what else lies in the same folder has nothing to do with it."""
_WORDS = {"earlier": "Made from", "later": "Continued in"}
Way = Literal["earlier", "later"]
Links = dict[tuple[str, str], str]
"""Title of a page by way and address; both escaped."""


def connect(page: Path, made_from: Iterable[Path]) -> None:
    """Link a page with those that it was made from, in both directions.

    A page that is absent, of another program, or in a folder that may not be written keeps its text.
    """
    for earlier in dict.fromkeys(made_from):
        with suppress(InputError, OperationError, OSError):
            head = read_head(page)
            if earlier.resolve() != page.resolve() and read_head(earlier).kind in _EARLIER.get(head.kind, ()):
                _link(page, earlier, "earlier")
                _link(earlier, page, "later")


def continued_in(earlier: Path, page: Path) -> None:
    """Link a page with one that was made from many of its kind, and lists them itself."""
    with suppress(InputError, OperationError, OSError):
        _link(earlier, page, "later")


def later_than(page: Path) -> list[Path]:
    """Pages that were made from a page, as the page names them. Raises InputError."""
    return [
        Path(os.path.normpath(page.parent / unquote(html.unescape(address))))
        for way, address in _links(_text(page)[1])
        if way == "later"
    ]


def _link(page: Path, to: Path, way: Way) -> None:
    head = read_head(to)
    text, inside = _text(page)
    address = html.escape(quote(os.path.relpath(to.resolve(), page.resolve().parent)))
    name = f"{head.kind}: {head.title}" if head.kind != "page" else head.title
    links = {**_links(inside), (way, address): html.escape(name)}
    place = f"<!--pages-->{_nav(links)}<!--/pages-->"
    if place != f"<!--pages-->{inside}<!--/pages-->":
        write_complete(page, _PLACE.sub(lambda _: place, text, count=1).encode())


def _text(page: Path) -> tuple[str, str]:
    """The page, and what its place for links holds. Raises InputError."""
    try:
        text = page.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise InputError(page, "cannot be read") from None
    place = _PLACE.search(text)
    if place is None:
        raise InputError(page, "has no place for links: an earlier version of acqd wrote the page")
    return text, place.group(1)


def _links(inside: str) -> Links:
    return {(way, address): name for way, address, name in _LINK.findall(inside)}


def _nav(links: Links) -> str:
    parts = []
    for way, words in _WORDS.items():
        names = [f'<a data-way="{w}" href="{address}">{name}</a>' for (w, address), name in links.items() if w == way]
        if names:
            parts.append(f"<p>{words}: {', '.join(names)}</p>")
    return f'<nav class="pages" aria-label="Other pages">{"".join(parts)}</nav>'
