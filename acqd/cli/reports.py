"""`acqd reports`: every report beneath a folder on one page."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import orjson
import typer

from acqd.atomic import write_complete
from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.errors import UserError
from acqd.extras import require


def reports(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder with reports, in folders of their own or not.")],
    out: Annotated[Path | None, typer.Option(help="The page (default: reports.html in DIR).")] = None,
    json: Json = False,
) -> None:
    """List the reports beneath a folder: what each is, of which robot, when it was written, and what it says.

    Files that are no reports of acqd, or are broken, are named with the reason.

    Example: acqd reports campaign
    """
    require("acqd reports", ("jinja2",), "loop")
    from acqd.report.head import require_kind
    from acqd.report.index import INDEX, KIND, index_page, pages_beneath, said, what

    if folder.is_file():
        raise UserError(f"{folder}: is a file, not a folder; name the folder that holds reports")
    page = out or folder / INDEX
    if page.suffix not in (".html", ".htm"):
        raise UserError(f"--out {page}: a page ends in .html")
    require_kind(page, KIND)
    found = pages_beneath(folder)
    write_complete(page, index_page(found, page).html().encode())
    if json:
        listed = [{"path": str(each.path), **asdict(each.head)} for each in found.pages]
        others = [{"path": str(path), "reason": why} for path, why in found.others]
        print(orjson.dumps({"folder": str(folder), "page": str(page), "reports": listed, "others": others}).decode())
        return
    console = terminal(tables=True)
    table = Table("file", "what", "robot", "says", "written (UTC)")
    for each in found.pages:
        name, head = str(each.path.relative_to(folder)), each.head
        table.add_row(name, what(head), head.subject, said(head), head.written.removesuffix(" UTC"))
    console.print(table)
    for path, why in found.others:
        console.print(f"not listed: {path}: {why}")
    console.print(f"page: {page}")
