"""Headless Chromium for the tests of pages; they are skipped where it, or playwright, is missing (extra `browser`)."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

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
    """What axe-core calls serious or critical, and whatever is wider than the window.

    Another look at a page that the light one has shown changes colours or the layout: only that is judged again.
    """
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs acqd[browser]")
    rules = getattr(page, "rules", None)
    options = {"resultTypes": ["violations"]} | ({"runOnly": {"type": "rule", "values": rules}} if rules else {})
    found = [] if rules == [] else axe.Axe().run(page, options=options).response["violations"]
    wide = page.evaluate("document.documentElement.scrollWidth > innerWidth")
    return [each["id"] for each in found if each["impact"] in ("serious", "critical")] + ["too wide"] * wide


def looks(browser) -> Iterator[object]:
    """New pages: light, dark, and as wide as a phone; errors of the console are in `page.errors`."""
    for width, scheme, rules in ((1200, "light", None), (1200, "dark", ["color-contrast"]), (390, "light", [])):
        page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        page.errors, page.rules = [], rules
        page.on("console", lambda message, page=page: message.type == "error" and page.errors.append(message.text))
        page.on("pageerror", lambda error, page=page: page.errors.append(str(error)))
        yield page
        page.close()
