"""What a command was told to write replaces what the command makes again, and nothing else."""

import os
import shutil

import pytest

from acqd.atomic import require_earlier, write_new
from acqd.errors import UserError
from acqd.models.bundle.bundle import load_metadata, require_made_again
from tests.commands import acqd_here, refused
from tests.models.test_old_files import FOLDER
from tests.sources.files import write_csv

PRECIOUS = b"time,P\n0,1\n"


def written(path, words):
    """Runs twice over its own product, and is refused over another file, which stays as it was."""
    path.write_bytes(PRECIOUS)
    line = refused(acqd_here(*words))
    assert str(path) in line and ("would be lost" in line or "replaces no file" in line)
    assert path.read_bytes() == PRECIOUS
    assert not [each for each in path.parent.iterdir() if each.name.startswith(f".{path.name}")]
    path.unlink()
    for _ in range(2):
        done = acqd_here(*words)
        assert done.returncode == 0, done.stderr
    assert path.read_bytes() != PRECIOUS


def test_tables_pages_and_rows_replace_their_like_only(tmp_path):
    write_csv(tmp_path / "recording.csv")
    causes = ("energy", "causes", FOLDER / "grey-box", FOLDER / "dataset")
    table, page = tmp_path / "e.csv", tmp_path / "e.html"
    written(table, [*causes, "--csv", table])
    written(page, ["energy", "work", FOLDER / "dataset", "--html", page])
    written(page.with_name("g.html"), ["guide", tmp_path, "--html", page.with_name("g.html")])
    assert "would be lost" in refused(acqd_here("guide", tmp_path, "--html", page))  # a page of another kind
    rows = tmp_path / "rows.jsonl"
    written(rows, ["replay", tmp_path / "recording.csv", "--out", rows])


def test_a_prediction_never_replaces_the_log(tmp_path):
    log = tmp_path / "log.csv"
    log.write_bytes(PRECIOUS)
    from acqd.models.predict import Prediction

    with pytest.raises(UserError, match="would be lost"):
        Prediction.write(None, log)
    assert log.read_bytes() == PRECIOUS


@pytest.mark.parametrize("name", ["now.npz", "now.cff", "now.cfg", "now.dat"])
def test_a_capture_replaces_nothing(name, tmp_path):
    write_csv(tmp_path / "recording.csv")
    words = ["capture", tmp_path / "recording.csv", "--to", "0.1", "--out", tmp_path / name]
    assert acqd_here(*words).returncode == 0
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert "replaces no file" in refused(acqd_here(*words))
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_model_is_replaced_by_the_same_one_only(tmp_path):
    out = shutil.copytree(FOLDER / "grey-box", tmp_path / "m")
    earlier = load_metadata(out)
    dataset = shutil.copytree(FOLDER / "dataset", tmp_path / "another")
    line = refused(acqd_here("train", dataset, "--network", "grey-box", "--out", out))
    assert "holds another model" in line and load_metadata(out) == earlier
    require_made_again(out, lambda metadata: metadata == earlier)
    (out / "bundle.json").write_text("{")
    require_made_again(out, lambda _: False)  # damaged: made again is what helps


@pytest.mark.parametrize("links", [True, False])
def test_a_new_file_is_complete_and_the_first_one_stays(links, tmp_path, monkeypatch):
    if not links:  # as on FAT

        def refuse(*_):
            raise PermissionError(1, "Operation not permitted")

        monkeypatch.setattr(os, "link", refuse)
    write_new(tmp_path / "a", b"first")
    with pytest.raises(FileExistsError):
        write_new(tmp_path / "a", b"second")
    assert [(each.name, each.read_bytes()) for each in tmp_path.iterdir()] == [("a", b"first")]


def test_an_empty_file_and_no_file_may_be_written(tmp_path):
    require_earlier(tmp_path / "none", b"mark", "table")
    (tmp_path / "empty").touch()
    require_earlier(tmp_path / "empty", b"mark", "table")
