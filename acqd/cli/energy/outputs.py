"""Files that `acqd energy` and its subcommands write."""

from __future__ import annotations

from pathlib import Path

from acqd.atomic import require_page, require_writable
from acqd.errors import UserError
from acqd.extras import require


def check_outputs(command: str, csv: Path | None, html: Path | None) -> None:
    """Before any work: names and folders of the files, and the libraries of a page. Raises UserError."""
    if csv is not None and csv.suffix != ".csv":
        raise UserError(f"--csv {csv}: expected a name that ends in .csv")
    if html is not None:
        require_page(html, "--html")
        require(f"{command} --html", ("jinja2", "matplotlib"), "lab")
    if csv is not None:
        if not csv.absolute().parent.is_dir():
            raise UserError(f"--csv {csv}: folder {csv.absolute().parent} does not exist; create it")
        require_writable(csv)
