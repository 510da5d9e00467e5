"""Headless Chromium for the tests of pages; they are skipped where it, or playwright, is missing (extra `browser`)."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

PHONE = 390
"""Pixels."""
_WIDE = r"""(phone) => {
  const found = [];
  if (document.scrollingElement.scrollWidth > innerWidth) found.push("the page is too wide");
  if (document.getElementById("page") && innerWidth <= phone)  // a report
    for (const box of document.querySelectorAll(".scroll:has(table)"))
      if (box.scrollWidth > box.clientWidth + 1) found.push(`too wide: ${box.ariaLabel}`);
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), range = document.createRange();
  while (texts.nextNode()) {
    const node = texts.currentNode;
    if (["SCRIPT", "STYLE", "CODE"].includes(node.parentElement.tagName)) continue;
    const dates = document.getElementById("page") ? /\d{4}-\d\d-\d\d/g : /(?!)/g;
    const sizes = /\d[ \u00a0](?:[kM]?Wh?|[mk]?[VA]|Hz|%|EUR|min|m?s|kg)(?!\w)/g;
    for (const match of [...node.data.matchAll(dates), ...node.data.matchAll(sizes)]) {
      range.setStart(node, match.index);
      range.setEnd(node, match.index + match[0].length);
      if (new Set([...range.getClientRects()].map(box => Math.round(box.bottom / 4))).size > 1)
        found.push(`divided by a line end: ${match[0]} in ${node.data.trim().slice(0, 60)}`);
    }
  }
  return found;
}"""
"""What a phone would have to scroll sideways for, and dates and numbers with units that a line end divides."""
_PROGRAMS = ("chromium", "chromium-browser", "google-chrome")


def needs_chromium() -> tuple[object, str]:
    """Playwright and the path of the browser. Skips the test where one is missing."""
    api = pytest.importorskip("playwright.sync_api", reason="needs acqd[browser]")
    program = next((path for name in _PROGRAMS if (path := shutil.which(name))), None)
    if program is None:
        pytest.skip(f"no {' or '.join(_PROGRAMS)} is installed")
    return api, program


@contextmanager
def chromium() -> Iterator[object]:
    """A browser of playwright."""
    api, program = needs_chromium()
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=program, args=["--no-sandbox", "--enable-unsafe-swiftshader"]
        )
        yield browser
        browser.close()


def serious_findings(page) -> list[str]:
    """What axe-core calls serious or critical, what is wider than the window, and moments that a line end divides.

    Another look at a page that the light one has shown changes colours or the layout: only that is judged again.
    """
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs acqd[browser]")
    rules = getattr(page, "rules", None)
    options = {"resultTypes": ["violations"]} | ({"runOnly": {"type": "rule", "values": rules}} if rules else {})
    found = [] if rules == [] else axe.Axe().run(page, options=options).response["violations"]
    wide = page.evaluate(_WIDE, PHONE)
    return [each["id"] for each in found if each["impact"] in ("serious", "critical")] + wide


def looks(browser) -> Iterator[object]:
    """New pages: light, dark, and as wide as a phone; errors of the console are in `page.errors`."""
    for width, scheme, rules in ((1200, "light", None), (1200, "dark", ["color-contrast"]), (PHONE, "light", [])):
        page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        page.errors, page.rules = [], rules
        page.on("console", lambda message, page=page: message.type == "error" and page.errors.append(message.text))
        page.on("pageerror", lambda error, page=page: page.errors.append(str(error)))
        yield page
        page.close()
