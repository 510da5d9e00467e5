"""Pages."""

import base64
import inspect
import struct

from matplotlib.figure import Figure

from acqd.report.page import Page


def test_a_picture_is_embedded_and_saved_as_it_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(Figure, "savefig", inspect.unwrap(Figure.savefig))  # as users get it (tests/conftest.py)
    figure = Figure(figsize=(4, 3), layout="constrained")
    figure.subplots().plot([1, 3, 2])
    page = Page("Pictures", simulated=False)
    page.figure(figure, "Power <W>", tmp_path / "power.png")
    page.write(tmp_path / "page.html")
    png = (tmp_path / "power.png").read_bytes()
    width, height = struct.unpack(">II", png[16:24])
    assert png.startswith(b"\x89PNG") and 400 < width < 600 and 300 < height < 450
    text = (tmp_path / "page.html").read_text()
    assert f"data:image/png;base64,{base64.b64encode(png).decode()}" in text
    assert "<figcaption>Power &lt;W&gt;</figcaption>" in text and "simulated data" not in text


def test_a_page_holds_other_pages(tmp_path):
    inner = Page("Inner <1>", simulated=True)
    inner.text("told")
    inner.write(tmp_path / "inner.html")
    outer = Page("Outer", simulated=True)
    outer.chapter("Chapter <1>", tmp_path / "inner.html")
    outer.write(tmp_path / "outer.html")
    page = (tmp_path / "outer.html").read_text()
    assert "<summary>Chapter &lt;1&gt;</summary><h1>Inner &lt;1&gt;</h1>" in page and page.count("<body>") == 1
