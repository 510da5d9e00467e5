"""Pages."""

import inspect
import struct
from html.parser import HTMLParser

import pytest
from matplotlib.figure import Figure

from acqd.report import KeyFigure, Page, Verdict
from acqd.report.bars import Bar, Bars, ranked
from tests.report.charts import chart
from tests.report.test_in_a_browser import arm_view


class _Tags(HTMLParser):
    """Elements that are open, and identifiers."""

    VOID = ("meta", "img", "br", "line", "path", "link", "use", "rect", "circle")

    def __init__(self, text):
        super().__init__()
        self.open, self.ids = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.ids += [value for name, value in attrs if name == "id"]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.ids += [value for name, value in attrs if name == "id"]

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.open.pop() == tag


def whole(page):
    """The page, with every element closed and every identifier once."""
    text = page.html()
    tags = _Tags(text)
    assert not tags.open and len(set(tags.ids)) == len(tags.ids)
    return text


def test_the_verdict_comes_first_and_the_footer_names_its_sources():
    page = Page("Residual <1>", simulated=True)
    page.lines(chart(), "A minute.")
    page.verdict(Verdict("found", "Payload & more", "", [KeyFigure("mass", "1.00 kg", "95 %")], ["weigh <it>"]))
    page.detail("seed", 7)
    text = whole(page)
    body = text.partition("<body>")[2]
    shown = ("Payload &amp; more", "1.00\u00a0kg", "weigh &lt;it&gt;")
    order = ["Residual &lt;1&gt;", "simulated data", *shown, "<figure"]
    assert [body.index(part) for part in order] == sorted(body.index(part) for part in order)
    footer = text[text.index("<footer>") :]
    assert "<dt>seed</dt><dd>7" in footer and "<dt>command</dt>" in footer and "acqd " in footer


def test_no_line_ends_between_a_number_and_its_unit():
    page = Page("Units", simulated=False)
    figure = KeyFigure("error", "4.77 -> 1.34 W", "95 %: 1 to 2 W")
    page.verdict(Verdict("found", "", "0.0206 kg m in 8 recordings", [figure]))
    page.table(["", "energy"], [["a", "20.9 kWh a year"], ["b", "17.0 Nm s/rad, 3 W sum"]])
    page.detail("command", "acqd lab execute --first 3 m")
    text = whole(page).replace("\u00a0", "_")
    for shown in (
        "0.0206_kg_m in 8 recordings",
        "17.0_Nm_s/rad, 3_W sum",
        "4.77 -&gt; 1.34_W",
        "95_%: 1 to 2_W",
        "20.9_kWh a year",
    ):
        assert shown in text
    assert "--first 3 m" in text  # a command is copied


@pytest.mark.parametrize(("value", "kind"), [("98 %", "short"), ("4.77 -> 1.34 W", ""), ("17.7 Nm s/rad", "long")])
def test_a_value_that_no_line_may_part_is_small_enough_for_its_column(value, kind):
    page = Page("Units", simulated=False)
    page.verdict(Verdict("found", "", "", [KeyFigure("size", value)]))
    shown = whole(page).replace("\u00a0", " ").partition("</b>")[0].rpartition("<b")[2]
    assert shown == (f' class="{kind}">' if kind else ">") + value.replace(">", "&gt;")


def test_a_heading_without_content_is_left_out_and_three_sections_have_contents():
    page = Page("Sections", simulated=False)
    for name in ("One", "Empty", "Two"):
        page.heading(name)
        if name != "Empty":
            page.text(f"about {name}")
    assert "Empty" not in whole(page) and "<nav" not in page.html()
    page.heading("Two")
    with page.folded("nothing"):
        pass
    assert page.html().count(">Two</h2>") == 1 and "nothing" not in page.html()
    with page.folded("raw <numbers>"):
        page.table(["name", "", "value [W]"], [["a<b", "", 1234.56], ["c", "", 0.0123456]])
    text = whole(page)
    assert text.count('<a href="#s') == 3 and "<summary>raw &lt;numbers&gt;</summary>" in text
    assert "a&lt;b" in text and "<td>1235</td>" in text and "<td>0.0123</td>" in text and "<th></th>" not in text


def test_bars_are_linear_and_sorted_with_the_winner_first():
    page = Page("Bars", simulated=False)
    rows = [Bar("worse", 1.0, "25 %"), Bar("best", 4.0, "100 %"), Bar("nothing", 0.0, "0 %")]
    page.bars(ranked(rows, "evidence [1]"), "")
    text = whole(page)
    assert text.index("best") < text.index("worse") < text.index("nothing")
    assert [w[:-1] for w in _widths(text)] == ["width: 100.0%", "width: 25.0%", "width: 0.0%"]


def test_bars_of_shares_are_relative_to_the_whole():
    """Seven percent, the largest of all, is no full bar."""
    page = Page("Bars", simulated=False)
    page.bars(Bars([Bar("best", 0.07, "7 %"), Bar("worse", 0.02, "2 %")], "share [%]", whole=1.0), "")
    assert [w[:-1] for w in _widths(whole(page))] == ["width: 7.0%", "width: 2.0%"]


def _widths(text):
    return [part.partition(">")[0] for part in text.split('style="')[1:] if part.startswith("width")]


def test_a_figure_follows_the_page_and_is_saved_as_it_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(Figure, "savefig", inspect.unwrap(Figure.savefig))  # as users get it (tests/conftest.py)
    figure = Figure(figsize=(4, 3), layout="constrained")
    axes = figure.subplots()
    axes.plot([1, 3, 2], color="#b45309")
    axes.set_xlabel("time [s]")
    page = Page("Pictures", simulated=False)
    page.figure(figure, "Power <W>", tmp_path / "power.png")
    page.figure(figure, "The same again", alt='falls "fast"')
    text = whole(page)
    width, height = struct.unpack(">II", (tmp_path / "power.png").read_bytes()[16:24])
    assert 400 < width < 600 and 300 < height < 450
    assert "var(--before)" in text and "#b45309" not in text.partition("<main>")[2] and "time [s]</text>" in text
    assert 'aria-label="Power &lt;W&gt;"' in text and 'aria-label="falls &quot;fast&quot;"' in text


def test_a_page_holds_other_pages(tmp_path):
    inner = Page("Inner <1>", simulated=True)
    inner.verdict(Verdict("fine", "all well"))
    inner.text("told")
    inner.lines(chart(), "A minute.")
    inner.write(tmp_path / "inner.html")
    outer = Page("Outer", simulated=True)
    for number in (1, 2):
        outer.chapter(f"Chapter <{number}>", tmp_path / "inner.html")
    text = whole(outer)
    assert "<summary>Chapter &lt;1&gt;</summary><h3>Inner &lt;1&gt;</h3>" in text and text.count("<body>") == 1


def test_an_arm_without_javascript_has_a_sentence():
    page = Page("Arm", simulated=True)
    page.arm(arm_view())
    assert "<noscript><p>The arm in motion needs JavaScript.</p></noscript>" in whole(page)
