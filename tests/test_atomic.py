"""Folders and files of results, before there is anything to write."""

import os

import pytest

from acqd.atomic import require_free, require_writable
from acqd.errors import UserError
from tests.commands import acqd_here


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
    done = acqd_here(*words, "--out", tmp_path / "file" / "x", cwd=tmp_path)
    assert (
        done.returncode == 2 and "file is not a folder that this user may write to; choose another --out" in done.stderr
    )
