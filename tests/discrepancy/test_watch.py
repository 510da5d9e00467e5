"""Watching a dataset that grows."""

import shutil
from pathlib import Path

import orjson
import pytest

from acqd.cli.watch_loop import sentence
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.watch import Watch
from acqd.errors import InputError
from acqd.models.bundle.bundle import load_bundle, save_bundle
from acqd.models.bundle.reference import reference_arrays
from tests.builders import grey, grey_bundle, recording, write_dataset


@pytest.mark.long(seconds=8)
def test_a_watch_raises_the_alarm_proposes_and_goes_on_after_a_restart(closed, tmp_path):
    folder, _ = closed
    order = CloseConfig(folder / "now" / "ds", folder / "model", tmp_path / "watch", only=("payload", "offset_shift"))
    events = list(Watch(order, 200 * 3600.0).look(lambda *_: None))
    kinds = [event.kind for event in events]
    assert kinds.count("recording") == 9 and kinds.count("alarm") == 1
    proposal = events[-1].details
    assert [effect["id"] for effect in proposal["effects"]] == ["payload"]
    assert load_bundle(Path(proposal["out"]) / "model").metadata["effects"]
    again = Watch(order, 200 * 3600.0)
    assert again.resumed.details["proposed"] and again.resumed.details["alarm"]["onset_s"] < 1e9 + 9000 + 180
    assert list(again.look(lambda *_: None)) == []  # nothing twice
    (order.out / "watch.json").write_text("{")
    with pytest.raises(InputError, match="delete it to start again"):
        Watch(order, 200 * 3600.0)


def judged_by(watch):
    return [event.details["recording"] for event in watch.look(lambda *_: None) if event.kind == "recording"]


@pytest.mark.long(seconds=3)
def test_recordings_are_known_by_their_content_not_by_their_names(closed, tmp_path):
    folder, _ = closed
    trained = load_bundle(folder / "model").metadata["provenance"]["fit_recordings"]
    ds = tmp_path / "ds"
    shutil.copytree(folder / "now" / "ds", ds)
    manifest = orjson.loads((ds / "manifest.json").read_bytes())
    manifest["recordings"] = manifest["recordings"][:2]
    for entry, name in zip(manifest["recordings"], trained, strict=False):
        entry["name"] = name  # as the recorder numbered its files in the campaign of the training
    (ds / "manifest.json").write_bytes(orjson.dumps(manifest))
    order = CloseConfig(ds, folder / "model", tmp_path / "watch")
    assert judged_by(Watch(order, 200 * 3600.0)) == trained[:2]
    for entry in manifest["recordings"]:
        entry["name"] += "_renamed"
    (ds / "manifest.json").write_bytes(orjson.dumps(manifest))
    again = Watch(order, 200 * 3600.0)
    assert again.resumed is not None and judged_by(again) == []
    training = CloseConfig(folder / "before" / "ds", folder / "model", tmp_path / "other")
    seen = judged_by(Watch(training, 200 * 3600.0))
    assert seen and not set(seen) & set(trained)  # the model's own test recordings only


def test_recordings_too_short_for_the_charts_are_said(tmp_path):
    model = grey()
    save_bundle(tmp_path / "model", grey_bundle(reference_arrays([recording(model, k) for k in range(8)])))
    rows_of = {20: 115, 21: 250}  # half of a block, 5 s, are 125 rows
    ds = write_dataset(tmp_path, [recording(model, k, rows=rows) for k, rows in rows_of.items()])
    order = CloseConfig(ds, tmp_path / "model", tmp_path / "watch")
    events = [event for event in Watch(order, 200 * 3600.0).look(lambda *_: None) if event.kind == "recording"]
    assert [event.details["judged"] for event in events] == [False, True]
    short, judged = (sentence(event) for event in events)
    assert short.endswith("; too short for the charts, which need 5 s without a gap") and judged.endswith("W RMS")
