"""Pictures of pages for the documentation, as headless Chromium shows them.

    python -m tools.docs.pictures TRIAL [--live PORT] [--out docs/pictures]
    python -m tools.docs.pictures --stories CIRCLES [--out docs/pictures]

TRIAL is the folder of an `acqd try`: its page becomes `try.png`, its closing report `closing-report.png` and `arm.png`,
the report of its dataset `dataset.png`, the list of `acqd reports` `reports.png`, and pages that are there of `acqd
next`, `acqd energy causes` and `acqd robot check` their own. --live takes `live-page.png` from an `acqd web` on this
port. --stories makes a picture of every `acqd lab investigate` below a folder: the report that leaves a question, the
program, and the report on both sessions, one below the other. All of these data are simulated, and every page says so
in the picture.
"""

from __future__ import annotations

import argparse
import io
import math
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acqd.errors import UserError

PICTURES = Path(__file__).parents[2] / "docs" / "pictures"
_PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
_WIDTH, _COLOURS, _MARGIN = 1000, 128, 16
_SETTLE_MS = 1500
"""A live page shows rows by then."""
_LIVE_MS = 45_000
"""Until its charts have something to show."""


@dataclass(frozen=True, slots=True)
class View:
    """What to take."""

    name: str
    address: str
    height: int
    """Pixels from the top."""
    wait_ms: int = _SETTLE_MS
    at: str = ""
    """Selector of what is shown; "" for the top of the page."""
    until: str = ""
    """Selector of what is shown last, in the place of `height`."""


def views(trial: Path, live: int | None) -> list[View]:
    """Pages that are there."""
    loop = trial / "after.ds.loop"
    files = (
        ("try", trial / "index.html", 1560),
        ("closing-report", loop / "report.html", 1290),
        ("dataset", trial / "after.ds" / "report.html", 820),
        ("reports", trial / "reports.html", 660),
        ("campaign", trial / "after" / "report.html", 620),
        ("next", trial / "after.ds.loop.next" / "next.html", 900),
        ("energy-causes", trial / "causes.html", 980),
        ("robot-check", trial / "robot.html", 860),
    )
    found = [View(name, path.resolve().as_uri(), height) for name, path, height in files if path.exists()]
    if (loop / "report.html").exists():
        found.append(View("arm", (loop / "report.html").resolve().as_uri(), 1160, 4 * _SETTLE_MS, ".moving"))
    if live is not None:
        found.append(View("live-page", f"http://127.0.0.1:{live}/", 900, _LIVE_MS))
    return found


def stories(circles: Path) -> dict[str, list[View]]:
    """Question, program and answer of every circle below a folder, as far as it went."""
    found = {}
    for asked in sorted(circles.glob("*/investigate.json")):
        circle = asked.parent
        pages = (
            (circle / "after.ds.loop" / "report.html", ".tile dl"),
            (circle / "after.ds.loop.next" / "next.html", "table"), (circle / "both" / "report.html", ".tile dl"),
        )  # fmt: skip
        shown = [View("", path.resolve().as_uri(), 600, until=last) for path, last in pages if path.exists()]
        found[f"story-{circle.name}"] = shown
    return found


def take(shown: Mapping[str, Sequence[View]], out: Path) -> list[Path]:
    """Write the pictures, each of its views one below the other.

    Raises UserError without a browser or without a page.
    """
    program = next((path for name in _PROGRAMS if (path := shutil.which(name))), None)
    try:
        from PIL import Image
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise UserError(f"needs {error.name}: pip install 'acqd[browser]'") from None
    if program is None:
        raise UserError(f"no {' or '.join(_PROGRAMS)} is installed")
    if not any(shown.values()):
        raise UserError("no page was found; make a trial with acqd try, or a circle with acqd lab investigate")
    out.mkdir(parents=True, exist_ok=True)
    written = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=program, args=["--no-sandbox", "--enable-unsafe-swiftshader"]
        )
        for name, seen in shown.items():
            images = [Image.open(io.BytesIO(_shot(browser, view))).convert("RGB") for view in seen]
            whole = Image.new("RGB", (_WIDTH, sum(image.height for image in images)))
            top = 0
            for image in images:
                whole.paste(image, (0, top))
                top += image.height
            picture = out / f"{name}.png"
            whole.quantize(_COLOURS, dither=Image.Dither.NONE).save(picture, optimize=True)
            written.append(picture)
        browser.close()
    return written


def _shot(browser: Any, view: View) -> bytes:
    """PNG of a page, from the top or from what is to be shown."""
    page = browser.new_page(viewport={"width": _WIDTH, "height": view.height}, color_scheme="light")
    page.goto(view.address)
    if view.until:
        bottom = page.evaluate("(last) => document.querySelector(last).getBoundingClientRect().bottom", view.until)
        page.set_viewport_size({"width": _WIDTH, "height": math.ceil(bottom) + _MARGIN})
    if view.at:
        page.evaluate("(at) => document.querySelector(at).scrollIntoView()", view.at)
    page.wait_for_timeout(view.wait_ms)
    image: bytes = page.screenshot()
    page.close()
    return image


def main() -> None:
    """Take the pictures, print their sizes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trial", type=Path, nargs="?", metavar="TRIAL")
    parser.add_argument("--stories", type=Path, metavar="CIRCLES")
    parser.add_argument("--live", type=int, metavar="PORT")
    parser.add_argument("--out", type=Path, default=PICTURES)
    arguments = parser.parse_args()
    shown: dict[str, list[View]] = {} if arguments.stories is None else stories(arguments.stories)
    if arguments.trial is not None:
        shown |= {view.name: [view] for view in views(arguments.trial, arguments.live)}
    try:
        written = take(shown, arguments.out)
    except UserError as error:
        parser.exit(2, f"{parser.prog}: {error}\n")
    for path in written:
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
    total = sum(path.stat().st_size for path in PICTURES.glob("*.png"))
    print(f"all pictures: {total / 1000:.0f} kB")


if __name__ == "__main__":
    main()
