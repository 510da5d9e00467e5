"""`acqd archive` and `acqd replay --archive` as a user types them."""

import json

import pytest

from acqd.sources.load import load_waveform
from acqd.telemetry.row import json_lines
from acqd.timestamps import rfc3339
from tests.archive.box import UTC, FakeBox, mains, recorder
from tests.commands import acqd_here, refused

CODES = mains(1.5)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """An archive with a gap, and the rows that the daemon made."""
    root = tmp_path_factory.mktemp("kept")
    archive = recorder(root / "archive")
    box = FakeBox(archive)
    box.feed(CODES[:16_800])
    box.feed(CODES[20_000:], at=20_000)
    box.track.finish()
    archive.close()
    (root / "rows.jsonl").write_bytes(json_lines(box.rows))
    return root, box


def told(*arguments):
    done = acqd_here(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_list_verify_and_rows_against_those_that_are_stored(kept, tmp_path):
    root, box = kept
    listed = told("archive", "list", root / "archive")
    assert sum(each["samples"] for each in listed["segments"]) == len(CODES) - 3_200
    assert [gap["why"] for gap in listed["gaps"]] == ["the source sent none"]
    assert not any(each["faults"] for each in told("archive", "verify", root / "archive")["segments"])
    out = tmp_path / "again.jsonl"
    again = told("replay", "--archive", root / "archive", "--against", root / "rows.jsonl", "--out", out)
    assert again["against"]["same"] == again["rows"] == len(box.rows)
    assert out.read_bytes() == (root / "rows.jsonl").read_bytes()


@pytest.mark.parametrize("ending", ["npz", "wav", "csv", "cff"])
def test_an_export_is_read_by_replay(kept, tmp_path, ending):
    root, _ = kept
    begin, end = rfc3339(UTC + 500_000_000), rfc3339(UTC + 1_100_000_000)
    out = tmp_path / f"part.{ending}"
    given = told("archive", "export", root / "archive", "--from", begin, "--to", end, "--out", out)
    first, second = given["stretches"]
    assert (first["samples"], second["samples"]) == (6_800, 2_000)
    assert second["files"] == [str(tmp_path / f"part-2.{ending}")]
    if ending == "npz":
        waveform = load_waveform(out)
        assert (waveform.codes == CODES[10_000:16_800]).all() and waveform.start_utc_ns == UTC + 500_000_000
    out.unlink()
    line = refused(acqd_here("archive", "export", root / "archive", "--out", out))  # the second file is there
    assert "replaces no file" in line and not out.exists()
    told("archive", "export", root / "archive", "--from", begin, "--to", end, "--out", tmp_path / f"other.{ending}")
    out = tmp_path / f"other.{ending}"
    scale = ("--u-scale", "655.36", "--i-scale", "9.8304", "--map", "u1=0,i1=1") if ending == "wav" else ()
    (L1, *_) = told("replay", out, *scale)["channels"]
    assert 200 < L1["Vrms"] < 240


def test_what_cannot_be_is_one_line(kept, tmp_path):
    root, _ = kept
    folder = root / "archive"
    assert "--from lies after --to" in refused(
        acqd_here("replay", "--archive", folder, "--from", "2026-09-22", "--to", "2026-09-21")
    )
    assert "leave --mode out" in refused(acqd_here("replay", "--archive", folder, "--mode", "fixed"))
    assert "for --archive" in refused(acqd_here("replay", "a.npz", "--from", "2026-09-21"))
    assert "no such folder" in refused(acqd_here("archive", "list", tmp_path / "nowhere"))
    assert "holds no segments" in refused(acqd_here("archive", "list", tmp_path))
    assert "no samples of other" in refused(acqd_here("replay", "--archive", folder, "--device", "other"))
    assert "expected a name that ends" in refused(acqd_here("archive", "export", folder, "--out", "x.mat"))
