"""Putting recordings into a dataset that exists."""

import shutil

import pytest

from acqd.dataset import growing
from acqd.dataset.growing import write_more
from acqd.dataset.manifest import load_manifest
from acqd.errors import OperationError, UserError
from acqd.models.segments import load_dataset
from tests.dataset.logs import build_from, motion, write_log, write_logs


def content(folder):
    return {
        path.relative_to(folder): path.read_bytes()
        for path in folder.rglob("*")
        if path.suffix in (".parquet", ".json")
    }


@pytest.fixture
def grown(tmp_path):
    """A dataset of four logs; the folder of the logs holds three more."""
    build_from(write_logs(tmp_path / "logs", 4), tmp_path / "ds")
    write_logs(tmp_path / "logs", 3, first=5)
    return tmp_path / "logs", tmp_path / "ds"


def test_new_logs_are_put_in_and_the_others_stay_where_they_are(grown):
    logs, ds = grown
    before, files = load_manifest(ds), content(ds)
    report = build_from(logs, ds, append=True)
    after = load_manifest(ds)
    assert (report.recordings, report.known, report.version) == (3, 4, 2) and not report.refused
    assert after["recordings"][:4] == before["recordings"] and after["version"] == 2 and before["version"] == 1
    assert [entry["name"] for entry in after["recordings"][4:]] == after["appended"][0]["recordings"]
    assert all(content(ds)[name] == data for name, data in files.items() if name.suffix == ".parquet")
    assert {segment.recording for segment in load_dataset(ds).segments} == {f"rec_{k:04d}" for k in range(1, 8)}
    assert {path.name for path in ds.iterdir()} == {"manifest.json", "recordings", ".lock"}
    (logs / "bad.csv").write_text("no,log\n")
    with pytest.raises(
        UserError, match=r"nothing new, 7 of its logs .*; 1 cannot be used, the first: .*bad.csv: has no r"
    ):
        build_from(logs, ds, append=True)
    (logs / "bad.csv").unlink()
    with pytest.raises(UserError, match="nothing new, 7 of its logs are in the dataset"):
        build_from(logs, ds, append=True)
    once = build_from(logs, ds.parent / "once")
    assert once.recordings == 7 and load_manifest(ds)["version"] == 2


def test_content_counts_not_names(grown, tmp_path):
    logs, ds = grown
    (tmp_path / "more").mkdir()
    shutil.copy(logs / "rec_0002.csv", tmp_path / "more" / "renamed.csv")
    with pytest.raises(UserError, match="nothing new, 1 of its logs are in the dataset by content"):
        build_from(tmp_path / "more", ds, append=True)
    write_log(tmp_path / "more" / "rec_0003.csv", *motion(12, 99))
    write_log(tmp_path / "more" / "new.csv", *motion(12, 98))
    report = build_from(tmp_path / "more", ds, append=True)
    assert report.recordings == 1 and report.known == 1
    assert "rec_0003.csv: the dataset has another recording named rec_0003; rename this log" in report.refused[0]


def test_another_robot_step_or_power_is_refused(grown, tmp_path):
    logs, ds = grown
    files = content(ds)
    with pytest.raises(UserError, match="holds recordings of ur3e, not of ur10e"):
        build_from(logs, ds, append=True, robot="ur10e")
    with pytest.raises(UserError, match=r"has rows of 0.04 s, not of 0.1 s"):
        build_from(logs, ds, append=True, step_s=0.1)
    with pytest.raises(UserError, match="no such folder; acqd dataset build makes a dataset"):
        build_from(logs, tmp_path / "nowhere", append=True)
    assert content(ds) == files


@pytest.mark.parametrize("broken", ["write_complete", "acqd.dataset.schema.write_parquet"])
def test_nothing_is_left_when_it_cannot_be_written(grown, monkeypatch, broken):
    logs, ds = grown
    files = content(ds)

    def fail(*_):
        raise OSError(28, "No space left on device")

    if broken == "write_complete":
        monkeypatch.setattr(growing, broken, fail)
    else:
        monkeypatch.setattr(broken, fail)
    with pytest.raises(OperationError, match="No space left on device; the dataset is as it was"):
        build_from(logs, ds, append=True)
    assert content(ds) == files
    monkeypatch.undo()
    assert build_from(logs, ds, append=True).recordings == 3


def test_two_builds_at_once_do_not_overwrite_each_other(grown):
    logs, ds = grown
    before = growing.Existing(load_manifest(ds), (ds / "manifest.json").read_bytes())
    build_from(logs, ds, append=True)
    files = content(ds)
    with pytest.raises(UserError, match="another build has put recordings into it meanwhile"):
        write_more(ds, before, b"{}", 2, lambda folder: None)
    with growing._lock(ds), pytest.raises(UserError, match="another build is putting recordings into it"):
        write_more(ds, before, b"{}", 2, lambda folder: None)
    assert content(ds) == files
