"""A report with every kind of block, as readers see it."""

import pytest
from matplotlib.figure import Figure

from acqd.report import KeyFigure, Page, Verdict
from acqd.report.bars import Bar, ranked
from tests.browser import chromium, looks, serious_findings
from tests.report.charts import chart

pytestmark = pytest.mark.browser


def test_a_report_has_no_serious_accessibility_finding_and_shows_its_values(tmp_path):
    figure = Figure(figsize=(9, 3))
    figure.subplots().plot([1, 2])
    page = Page("Everything", simulated=True)
    for tone in ("found", "fine", "open", "bad"):
        page.verdict(Verdict(tone, f"A verdict: {tone}", "why", [KeyFigure("mass", "1 kg", "note")], ["do this"]))
        for name in ("One", "Two", "Three"):
            page.heading(name)
        page.table(["name", "value [W]", "a long explanation in words"], [["P", 1.0, "measured at the mains " * 9]])
        page.figure(figure, "A line")
        page.bars(ranked([Bar("best", 2.0, "2 W"), Bar("worst", 1.0, "1 W", "muted")], "power [W]"), "")
        page.lines(chart(), "A minute.")
        page.write(tmp_path / f"{tone}.html")
    with chromium() as browser:
        for view in looks(browser):
            for tone in ("found", "fine", "open", "bad") if view.rules is None else ("bad",):
                view.goto((tmp_path / f"{tone}.html").as_uri())
                assert serious_findings(view) == [] and view.errors == []
            view.focus(".chart [tabindex]")
            for key in ("Home", "ArrowRight"):
                view.keyboard.press(key)
            assert "time [s]: 0.04" in view.inner_text(".readout")
