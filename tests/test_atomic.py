"""Folders and files of results, before there is anything to write."""

import errno
import os
from pathlib import Path

import pytest

from acqd.atomic import replace_file, require_free, require_page, require_writable, write_complete
from acqd.errors import UserError
from acqd.report.page import Page
from tests.commands import acqd_here, refused


def test_a_place_that_cannot_be_made_is_refused_before_the_work(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    require_writable(tmp_path / "new" / "newer")
    with pytest.raises(UserError, match=r"file/x: .*/file is not a folder that this user may write to; choose another"):
        require_writable(tmp_path / "file" / "x")
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(UserError, match="is not a folder that this user may write to"):
        require_free(tmp_path / "x", "report.json", "report")


@pytest.mark.parametrize(
    "words",
    [
        ("close-loop", "nosuch", "--model", "nosuch"),
        ("compare", "nosuch"),
        ("dataset", "build", "--power", "nosuch.csv", "--logs", "nosuch"),
        ("next", "nosuch"),
        ("save", "nosuch", "nosuch.log"),
    ],
)
def test_long_commands_look_at_their_place_first(words, tmp_path):
    (tmp_path / "file").write_text("")
    done = acqd_here(*words, "--out", tmp_path / "file" / "x.html", cwd=tmp_path)
    assert (
        done.returncode == 2 and "file is not a folder that this user may write to; choose another --out" in done.stderr
    )


def test_a_full_disk_leaves_what_was_there(tmp_path, monkeypatch):
    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    Page("Plant", simulated=True).write(tmp_path / "plant.html")
    of_yesterday = (tmp_path / "plant.html").read_text()
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(UserError, match=r"plant.html: cannot be written \(No space left on device\)"):
        Page("Plant", simulated=True).write(tmp_path / "plant.html")
    for words in (("config", "init", "a.toml"), ("lab", "campaign", "--out", "c", "--limited", "1", "--all", "0")):
        done = acqd_here(*words, cwd=tmp_path)
        assert done.returncode == 2 and "No space left on device" in done.stderr
    assert [path.name for path in sorted(tmp_path.rglob("*")) if path.is_file()] == ["plant.html"]
    assert (tmp_path / "plant.html").read_text() == of_yesterday


def test_what_is_no_file_is_written_to(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    replace_file(tmp_path / "pipe", b"page")
    assert os.read(reader, 10) == b"page" and (tmp_path / "pipe").is_fifo()
    os.close(reader)
    replace_file(tmp_path / "pipe", b"nobody reads")
    assert (tmp_path / "pipe").read_bytes() == b"nobody reads"


def test_a_page_for_the_standard_output_of_a_pipeline_is_written_to_it(tmp_path):
    """`/dev/stdout` is a link that leads to no name of a file."""
    reader, writer = os.pipe()
    Page("Plant", simulated=True).write(Path(f"/dev/fd/{writer}"))
    os.close(writer)
    with open(reader, encoding="utf-8") as page:
        assert "Plant" in page.read()


def test_a_link_stays_one_and_its_file_is_replaced(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "disk" / "table.csv").write_text("old")
    (tmp_path / "table.csv").symlink_to("disk/table.csv")
    write_complete(tmp_path / "table.csv", b"new")
    assert (tmp_path / "table.csv").is_symlink() and (tmp_path / "disk" / "table.csv").read_text() == "new"
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["disk", "table.csv", "table.csv"]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("acqd.sqlite", r"--out .*acqd.sqlite: a report ends in .html; choose another --out"),
        ("folder.html", r"--out .*folder.html: is a folder; expected a file"),
        ("none/x.html", r"--out .*x.html: folder .*none does not exist; create it"),
    ],
)
def test_a_page_takes_the_place_of_no_other_file(name, said, tmp_path):
    (tmp_path / "acqd.sqlite").write_text("rows")
    (tmp_path / "folder.html").mkdir()
    with pytest.raises(UserError, match=said):
        require_page(tmp_path / name)
    assert require_page(tmp_path / "x.html") is None


@pytest.mark.parametrize(
    "words",
    [
        ("plant", "page", "--out"),
        ("plant", "month", "--out"),
        ("en50160", "--declared-voltage", "230", "--out"),
        ("conformance", "--out"),
        ("compare", "nosuch", "--out"),
        ("energy", "--html"),
        ("robot", "check", "ur5e", "--out"),
        ("robot", "ability", "nosuch", "--html"),
    ],
)
def test_every_command_that_writes_a_page_keeps_other_files(words, tmp_path):
    (tmp_path / "acqd.sqlite").write_text("rows")
    assert f"{words[-1]} acqd.sqlite: a report ends in .html" in refused(acqd_here(*words, "acqd.sqlite", cwd=tmp_path))
    assert (tmp_path / "acqd.sqlite").read_text() == "rows"
