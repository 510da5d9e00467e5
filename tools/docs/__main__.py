"""python -m tools.docs [--out site]: the documentation as a web site, and man pages in OUT/man/man1."""

from __future__ import annotations

import argparse
from pathlib import Path

from acqd.cli.main import for_people
from tools.docs.manpages import write_man_pages
from tools.docs.site import build_site


def main() -> None:
    """Build both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("site"))
    out = parser.parse_args().out
    build_site(out)
    pages = write_man_pages(out / "man" / "man1")
    print(f"{out}/index.html; {len(pages)} man pages in {out}/man/man1: man -M {out}/man acqd")


if __name__ == "__main__":
    for_people(main)
