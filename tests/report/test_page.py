"""Pages."""

from acqd.report.page import Page


def test_a_page_holds_other_pages(tmp_path):
    inner = Page("Inner <1>", simulated=True)
    inner.text("told")
    inner.write(tmp_path / "inner.html")
    outer = Page("Outer", simulated=True)
    outer.chapter("Chapter <1>", tmp_path / "inner.html")
    outer.write(tmp_path / "outer.html")
    page = (tmp_path / "outer.html").read_text()
    assert "<summary>Chapter &lt;1&gt;</summary><h1>Inner &lt;1&gt;</h1>" in page and page.count("<body>") == 1
