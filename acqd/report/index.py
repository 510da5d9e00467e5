"""All pages beneath a folder as one page: what each of them is, of which robot, when it was written, what it says."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from acqd.errors import InputError, UserError, no_folder
from acqd.report.blocks import Link
from acqd.report.digits import counted
from acqd.report.head import Head, read_head
from acqd.report.page import Page
from acqd.report.verdict import KeyFigure, Tone, Verdict

INDEX = "reports.html"
KIND = "index"
_SUFFIXES = (".html", ".htm")
_ORDER: tuple[Tone, ...] = ("bad", "found", "open", "fine")
"""What asks for somebody comes first."""
CLOSING = "closing report"
_STATES = {"found": "cause found", "open": "question open", "fine": "no cause to find"}
"""Of closing reports: another page may have found the best model."""


@dataclass(frozen=True, slots=True)
class Listed:
    """A page that was read."""

    path: Path
    head: Head


@dataclass(frozen=True, slots=True)
class Pages:
    """What lies beneath a folder."""

    folder: Path
    pages: list[Listed]
    """By verdict and time, the newest first."""
    others: list[tuple[Path, str]]
    """Files that end like pages, and why they are not listed."""


def pages_beneath(folder: Path) -> Pages:
    """Read the heads of all pages. Links to folders are not followed. Raises UserError for no folder, and no report."""
    if not folder.is_dir():
        raise UserError(f"{folder}: {no_folder(folder)}; name one that holds reports")
    pages, others = [], []
    for path in sorted(_files(folder)):
        try:
            head = read_head(path)
        except InputError as error:
            others.append((path, str(error).removeprefix(f"{path}: ")))
            continue
        if head.kind != KIND:
            pages.append(Listed(path, head))
    if not pages:
        raise UserError(f"{folder}: no report of acqd in it{_first_of(others)}; name a folder that holds reports")
    pages.sort(key=lambda each: each.head.written, reverse=True)
    pages.sort(key=lambda each: _ORDER.index(each.head.verdict.tone))
    return Pages(folder, pages, others)


def _first_of(others: list[tuple[Path, str]]) -> str:
    """Of files that are no reports the first one, and why."""
    if not others:
        return ""
    (path, why), *more = others
    return f" ({path}: {why}{f', and {len(more)} more' if more else ''})"


def _files(folder: Path) -> Iterator[Path]:
    """Pages, without hidden folders: reports that are being written are in these. Raises UserError."""

    def refuse(error: OSError) -> None:
        if Path(error.filename) == folder:
            raise UserError(f"{folder}: cannot be read ({error.strerror})")

    for parent, folders, names in os.walk(folder, onerror=refuse):
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (Path(parent) / name for name in names if Path(name).suffix.lower() in _SUFFIXES)


def index_page(found: Pages, out: Path) -> Page:
    """The page, to be written to `out`."""
    simulated = all(each.head.simulated for each in found.pages)
    page = Page(f"Reports in {found.folder.resolve().name}", simulated=simulated, kind=KIND)
    page.verdict(_verdict(found))
    page.heading("Pages")
    page.table(
        ["page", "what", "robot or device", "says", "written (UTC)"],
        [
            (
                Link(str(each.path.relative_to(found.folder)), _address(each.path, out)), what(each.head),
                each.head.subject, said(each.head), each.head.written.removesuffix(" UTC"),
            )
            for each in found.pages
        ],
    )  # fmt: skip
    page.heading("Files that are not listed")
    if found.others:
        page.table(["file", "why"], [(str(path.relative_to(found.folder)), why) for path, why in found.others])
    return page


def what(head: Head) -> str:
    """What a page is; a page of an earlier version has only its title."""
    return head.kind if head.kind != "page" else head.title


def said(head: Head) -> str:
    """The verdict of a page in a line; simulated data are said to be so."""
    return f"{head.verdict.headline}{' (simulated)' if head.simulated and head.verdict.headline else ''}"


def _verdict(found: Pages) -> Verdict:
    closing = [each.head.verdict.tone for each in found.pages if each.head.kind == CLOSING]
    wrong = sum(each.head.verdict.tone == "bad" for each in found.pages)
    figures = [KeyFigure("wrong", str(wrong), f"of {counted(len(found.pages), 'page')}")] if wrong else []
    figures += [
        KeyFigure(words, str(closing.count(tone)), f"of {counted(len(closing), CLOSING)}")
        for tone, words in _STATES.items() if tone in closing
    ]  # fmt: skip
    if found.others:
        figures.append(KeyFigure("not listed", str(len(found.others)), "see below"))
    bad: list[Tone] = ["bad"] if wrong else []
    tones: list[Tone] = [*closing, *bad, "fine"]
    return Verdict(min(tones, key=_ORDER.index), counted(len(found.pages), "page"), "", figures)


def _address(path: Path, out: Path) -> str:
    return quote(os.path.relpath(path.resolve(), out.resolve().parent))
