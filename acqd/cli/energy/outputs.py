"""Files that `acqd energy` and its subcommands write."""

from __future__ import annotations

from pathlib import Path

from acqd.atomic import require_writable
from acqd.errors import UserError
from acqd.extras import require


def check_outputs(command: str, csv: Path | None, html: Path | None) -> None:
    """Before any work: names and folders of the files, and the libraries of a page. Raises UserError."""
    if csv is not None and csv.suffix != ".csv":
        raise UserError(f"--csv {csv}: expected a name that ends in .csv")
    if html is not None:
        if html.suffix not in (".html", ".htm"):
            raise UserError(f"--html {html}: expected a name that ends in .html")
        require(f"{command} --html", ("jinja2", "matplotlib"), "lab")
    for path in (csv, html):
        if path is not None and not path.absolute().parent.is_dir():
            raise UserError(f"{path}: folder {path.absolute().parent} does not exist; create it")
        if path is not None:
            require_writable(path)
