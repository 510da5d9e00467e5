"""`acqd capture` of recordings, and `acqd replay --events`, as a user runs them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from acqd.metering import StreamFormat
from acqd.sources import load_waveform
from acqd.sources.npz_write import npz_bytes
from acqd.sources.waveform import Waveform
from acqd.telemetry.broker import free_port
from tests.commands import acqd_here, refused
from tests.metering.quality.disturbed import form, voltages


@pytest.fixture
def recording(tmp_path):
    """Three phases with a dip to 50 % from 1.0 to 1.2 s, from 2023-11-14T22:13:20Z on (simulated)."""
    u = voltages(lambda t, _: np.where((t > 1) & (t < 1.2), 0.5, 1.0), seconds=2.0)
    waveform = Waveform("r", np.repeat(u, 2, axis=1), form(), 1_700_000_000 * 10**9, simulated=True)
    (tmp_path / "r.npz").write_bytes(npz_bytes(waveform))
    return tmp_path / "r.npz"


def test_a_part_of_a_recording_begins_and_ends_where_it_was_asked_to(recording, tmp_path):
    for limits in (("0.9", "1.3"), ("2023-11-14T22:13:20.9Z", "2023-11-14T22:13:21.3+00:00")):
        (tmp_path / "p.npz").unlink(missing_ok=True)
        done = acqd_here("capture", recording, "--from", limits[0], "--to", limits[1], "--out", "p.npz", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        part, whole = load_waveform(tmp_path / "p.npz"), load_waveform(recording)
        assert part.start_utc_ns == 1_700_000_000_900_000_000 and part.simulated
        np.testing.assert_array_equal(part.codes, whole.codes[9_000:13_000])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--from", "3"], "is no part"), (["--from", "1", "--to", "1"], "is no part"), (["--from", "-1"], "is no part"),
        (["--to", "nan"], "expected seconds"), (["--from", "soon"], "expected seconds"),
        (["--seconds", "1"], "for the running daemon"), (["--device", "x"], "for the running daemon"),
    ],
)  # fmt: skip
def test_impossible_parts_are_refused(recording, tmp_path, words, says):
    assert says in refused(acqd_here("capture", recording, *words, "--out", "p.npz", cwd=tmp_path))
    assert not (tmp_path / "p.npz").exists()


def test_outputs_that_cannot_be_are_refused(recording, tmp_path):
    assert "ends in .npz" in refused(acqd_here("capture", recording, "--out", "p.wav", cwd=tmp_path))
    assert "does not exist" in refused(acqd_here("capture", recording, "--out", "no/p.npz", cwd=tmp_path))
    assert "replaces no file" in refused(acqd_here("capture", recording, "--out", recording, cwd=tmp_path))
    assert "for a recording" in refused(acqd_here("capture", "--from", "1", "--out", "p.npz", cwd=tmp_path))


def test_a_daemon_that_is_not_there_is_a_failure_in_one_line(tmp_path):
    (tmp_path / "acqd.toml").write_text(f"[health]\nport = {free_port()}\n")
    done = acqd_here("capture", "--config", "acqd.toml", "--out", "p.npz", cwd=tmp_path)
    assert done.returncode == 1 and "is the daemon running?" in done.stderr
    (tmp_path / "acqd.toml").write_text("[health]\nport = 0\n")
    assert "port is 0" in refused(acqd_here("capture", "--config", "acqd.toml", "--out", "p.npz", cwd=tmp_path))


def test_replay_writes_the_events_of_each_recording(recording, tmp_path):
    options = ["--events", "e.jsonl", "--declared-voltage", "230", "--json"]
    done = acqd_here("replay", recording, recording, *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first, second = [json.loads(line) for line in (tmp_path / "e.jsonl").read_text().splitlines()]
    assert (first["kind"], first["number"], second["number"]) == ("dip", 0, 1)
    assert first["flags"] == ["simulated"] and first["time"][:21] in ("2023-11-14T22:13:20.9", "2023-11-14T22:13:21.0")
    assert first["extreme"] == pytest.approx(115, abs=0.5) and json.loads(done.stdout)["events"] == 2


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--events", "e"], "needs --declared-voltage"), (["--declared-voltage", "230"], "for --events"),
        (["--events", "e", "--declared-voltage", "much"], "expected a number"),
        (["--events", "e", "--declared-voltage", "-1"], "greater than 0"),
        (["--events", "e", "--declared-voltage", "230", "--thresholds", "dip=101"], "dip < 100 %"),
        (["--events", "e", "--declared-voltage", "230", "--thresholds", "sag=9"], "is not like dip=90"),
        (["--events", "e", "--declared-voltage", "230", "--out", "e"], "separate files"),
    ],
)  # fmt: skip
def test_events_that_nobody_can_find_are_refused(recording, tmp_path, words, says):
    assert says in refused(acqd_here("replay", recording, *words, cwd=tmp_path))
    assert not (tmp_path / "e").exists()


def test_a_voltage_that_nobody_has_declared_may_be_its_own_reference(recording, tmp_path):
    acqd_here("replay", recording, "--events", "e", "--declared-voltage", "sliding", cwd=tmp_path)
    event = json.loads((tmp_path / "e").read_text())
    assert event["sliding"] and event["reference"] == pytest.approx(230, rel=1e-3)


def test_flicker_needs_ten_minutes(tmp_path):
    t = np.arange(10_000) / 2_000
    u = 325 * np.sin(2 * np.pi * 50 * t) * np.where(t < 2.5, 1.0, 0.98)
    waveform = Waveform("f", np.column_stack([u, u]), StreamFormat(2_000.0, (1.0, 1.0), 50.0, 64), None)
    (tmp_path / "f.npz").write_bytes(npz_bytes(waveform))
    assert "needs 600 s" in refused(acqd_here("replay", "f.npz", "--flicker", "f", cwd=tmp_path))
    done = acqd_here("replay", "f.npz", "--loops", "125", "--flicker", "f", "--lamp", "120V", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (line,) = [json.loads(line) for line in (tmp_path / "f").read_text().splitlines()]
    assert (line["channel"], line["lamp"], line["flags"]) == ("L1", "120V", [])
    assert 0.5 < line["Pst"] < 5  # 24 changes of 2 % a minute
