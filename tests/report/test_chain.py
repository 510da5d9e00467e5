"""Links between pages, what a page says about itself, and the page of pages."""

import json
import re
from itertools import pairwise

import pytest

from acqd.errors import InputError, UserError
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.chain import connect, later_than
from acqd.report.head import read_head
from acqd.report.index import index_page, pages_beneath
from tests.commands import acqd_here, refused


def write(path, kind, title="Title <1>", verdict=None):
    path.parent.mkdir(parents=True, exist_ok=True)
    page = Page(title, simulated=True, kind=kind, subject="iiwa7_r800")
    page.verdict(verdict or Verdict("found", f"Found in {kind}", "</script><b>", [KeyFigure("mass", "1 kg")], ["go"]))
    page.text("text")
    page.write(path)
    return path


@pytest.fixture
def three(tmp_path):
    """Pages of a dataset, a loop, and the next motion."""
    return [
        write(tmp_path / name / "report.html", kind)
        for name, kind in (("my ds", "dataset"), ("loop", "closing report"), ("loop.next", "next"))
    ]


def test_a_page_says_what_it_is(three):
    head = read_head(three[1])
    assert (head.kind, head.subject, head.simulated, head.title) == ("closing report", "iiwa7_r800", True, "Title <1>")
    assert head.verdict == Verdict(
        "found", "Found in closing report", "</script><b>", [KeyFigure("mass", "1 kg")], ["go"]
    )
    assert head.by.startswith("acqd ") and head.written.endswith(" UTC")


def test_pages_are_linked_in_both_directions_once_and_by_paths_that_move_with_the_folder(three, tmp_path):
    dataset, loop, following = three
    for _ in range(2):
        connect(loop, [dataset, tmp_path / "absent" / "report.html"])
        connect(following, [loop])
    links = re.findall(r'data-way="(\w+)" href="([^"]*)"', loop.read_text())
    assert links == [("earlier", "../my%20ds/report.html"), ("later", "../loop.next/report.html")]
    assert later_than(dataset) == [loop] and later_than(loop) == [following] and later_than(following) == []
    assert "dataset: Title &lt;1&gt;</a>" in loop.read_text()
    assert read_head(loop).kind == "closing report"


def test_what_only_lies_in_the_same_folder_and_what_cannot_be_written_is_not_linked(three, tmp_path):
    _, loop, following = three
    before = [page.read_text() for page in three]
    connect(loop, [following])  # no loop is made from a designed motion
    (tmp_path / "other.html").write_text("<html><title>Other</title></html>")
    connect(loop, [tmp_path / "other.html"])
    assert [page.read_text() for page in three] == before


def test_reports_lists_every_page_and_names_what_it_cannot_read(three, tmp_path):
    write(tmp_path / "bad.html", "fleet", verdict=Verdict("bad", "3 robots failed"))
    (tmp_path / "foreign.html").write_text("<html><title>Holiday</title></html>")
    (tmp_path / "empty.html").write_bytes(b"")
    (tmp_path / "binary.html").write_bytes(bytes(range(256)))
    (tmp_path / "cut.html").write_text(three[0].read_text()[:-200])
    marked = '<script type="application/json" id="page">'
    (tmp_path / "newer.html").write_text(three[0].read_text().replace(marked, f'{marked}{{"x":1}}</script><i>', 1))
    tone = three[0].read_text().replace('"tone": "', '"tone": "un', 1)
    (tmp_path / "tone.html").write_text(tone)
    (tmp_path / "gone.html").symlink_to(tmp_path / "nothing")
    old = re.sub(f"{marked}.*?</script>", "", three[1].read_text(), count=1)
    (tmp_path / "old.html").write_text(old.replace("<!--pages--><!--/pages-->", ""))
    hidden = tmp_path / ".loop.half"
    hidden.mkdir()
    (hidden / "report.html").write_text("half")
    done = acqd_here("reports", tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    names = [each["path"].removeprefix(f"{tmp_path}/") for each in told["reports"]]
    assert names[0] == "bad.html" and set(names[1:]) == {
        "old.html", *(str(page.relative_to(tmp_path)) for page in three)
    }  # fmt: skip
    earlier = next(each for each in told["reports"] if each["path"].endswith("old.html"))["verdict"]
    assert earlier["headline"] == "Found in closing report" and earlier["tone"] == "found"
    reasons = {each["path"].rpartition("/")[2]: each["reason"] for each in told["others"]}
    assert {name: reason.split(":")[0] for name, reason in reasons.items()} == {
        "foreign.html": "is no page of acqd", "empty.html": "is no page of acqd", "binary.html": "is no page of acqd",
        "cut.html": "is cut off", "newer.html": "has a head that this version of acqd does not read",
        "tone.html": "has a head that this version of acqd does not read",
        "gone.html": "no such file",
    }  # fmt: skip
    text = (tmp_path / "reports.html").read_text()
    assert 'href="my%20ds/report.html">my ds/report.html</a>' in text and "foreign.html" in text
    again = acqd_here("reports", tmp_path)
    assert again.returncode == 0 and "not listed" in again.stdout and "reports.html" in again.stdout
    assert json.loads(acqd_here("reports", tmp_path, "--json").stdout)["reports"].__len__() == 5  # not the list itself


def test_the_list_counts_causes_of_closing_reports_alone(tmp_path):
    """The page of `acqd compare` has found the best model, that of a trial what its closing report has found."""
    for kind, tone in (
        ("closing report", "found"),
        ("closing report", "open"),
        ("models", "found"),
        ("trial", "found"),
    ):
        write(tmp_path / f"{kind} {tone}" / "report.html", kind, verdict=Verdict(tone, ""))
    verdict = index_page(pages_beneath(tmp_path), tmp_path / "reports.html").html()
    told = json.loads(re.search(r'id="page">(.*?)</script>', verdict).group(1))["verdict"]
    figures = {each["label"]: (each["value"], each["note"]) for each in told["figures"]}
    assert figures == {"cause found": ("1", "of 2 closing reports"), "question open": ("1", "of 2 closing reports")}
    assert (told["tone"], told["headline"]) == ("found", "4 pages")


def test_pages_of_fleet_plant_and_saving_are_linked_to_what_they_are_made_from(tmp_path):
    order = ("dataset", "models", "closing report", "fleet", "plant")
    pages = [write(tmp_path / kind / "report.html", kind) for kind in order]
    for earlier, later in pairwise(pages):
        connect(later, [earlier])
        assert later in later_than(earlier)
    for kind, earlier in (("month", "fleet"), ("saving", "models"), ("ability", "closing report")):
        page = write(tmp_path / f"{kind}.html", kind)
        connect(page, [pages[order.index(earlier)]])
        assert page in later_than(pages[order.index(earlier)])


def test_reports_replaces_no_file_that_is_not_a_list(three, tmp_path):
    assert "no such folder" in refused(acqd_here("reports", tmp_path / "nosuch"))
    (tmp_path / "power.sqlite").write_bytes(b"")
    assert "is a file, not a folder; name" in refused(acqd_here("reports", tmp_path / "power.sqlite"))
    assert "would be lost" in refused(acqd_here("reports", tmp_path, "--out", three[0]))
    assert "ends in .html" in refused(acqd_here("reports", tmp_path, "--out", tmp_path / "list.txt"))
    (tmp_path / "void").mkdir()
    assert "void: no report of acqd in it; name" in refused(acqd_here("reports", tmp_path / "void"))
    (tmp_path / "void" / "a.html").write_text("<html></html>")
    with pytest.raises(UserError, match=r"no report of acqd in it \(.*a\.html: is no page of acqd"):
        pages_beneath(tmp_path / "void")
    assert [path.name for path in (tmp_path / "void").iterdir()] == ["a.html"]


def test_a_page_that_is_gone_is_said_to_be(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_head(tmp_path / "nosuch.html")
