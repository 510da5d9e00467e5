"""What a notebook shows, types of what files hold, and data sets to try things out with."""

from __future__ import annotations

import json
import types
import typing

import pytest

import acqd
from acqd.api.records import Metadata, Report


def misfits(value, kind, place="report"):
    """Places where a value of JSON is not of the type."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if typing.is_typeddict(kind):
        inner = [(f"{place}.{key}", value.get(key, ...), hint) for key, hint in required(kind, value)]
    elif origin in (list, dict) and isinstance(value, origin):
        items = value.items() if origin is dict else enumerate(value)
        inner = [(f"{place}.{key}", one, arguments[-1]) for key, one in items]
    else:
        inner = []
        if not fits(value, kind, arguments):
            yield place
    for there, one, hint in inner:
        yield from misfits(one, hint, there)


def required(kind, value):
    """Keys with their types, of those that may lack only the present ones."""
    for key, hint in typing.get_type_hints(kind, include_extras=True).items():
        if typing.get_origin(hint) is not typing.NotRequired:
            yield key, hint
        elif key in value:
            yield key, typing.get_args(hint)[0]


def fits(value, kind, arguments):
    """Whether a value is one of several types, one of several words, or of a simple type."""
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        return any(not any(misfits(value, one)) for one in arguments)
    if typing.get_origin(kind) is typing.Literal:
        return value in arguments
    return isinstance(value, (kind, int) if kind is float else typing.get_origin(kind) or kind)


def test_a_data_set_shows_its_recordings(folder):
    shown = acqd.Dataset("ds")._repr_html_()
    assert shown.count("<tr>") == 1 + len(acqd.Dataset("ds").recordings)
    assert "ds: ur10e, 9 recordings, simulated" in shown and "<td>train</td>" in shown


def test_rows_models_and_robots_show_what_they_are(folder):
    rows = acqd.read_rows("power.csv")._repr_html_()
    assert " rows, simulated</caption>" in rows and "mean P [W]" in rows
    assert "model: grey_box of ur10e, 6 axes" in (shown := acqd.open_model("model")._repr_html_())
    assert "<td>test</td>" in shown
    assert "shoulder_pan</td><td>-360 to 360 deg" in acqd.Robot("ur10e")._repr_html_()


def test_a_result_shows_verdict_sizes_and_rivals(closed):
    report = json.loads((closed[0] / "now/ds.loop/report.json").read_bytes())
    result = acqd.LoopResult(closed[0] / "now/ds.loop", report)
    shown = result._repr_html_()
    assert shown.startswith("<table><caption>effects found: RMSE ") and "W after, simulated</caption>" in shown
    assert "<td>payload</td><td>flange</td><td>mass " in shown and " kg (" in shown
    effect = report["effects"][0] | {"where": "<b>", "rivals": [{"id": None, "name": "a & b", "confidence": 0.1}]}
    shown = acqd.LoopResult(closed[0], report | {"effects": [effect]})._repr_html_()
    assert "&lt;b&gt;" in shown and "a &amp; b 10 %" in shown


def test_types_are_those_of_the_files(closed):
    report = json.loads((closed[0] / "now/ds.loop/report.json").read_bytes())
    assert list(misfits(report, Report)) == []
    assert list(misfits(json.loads((closed[0] / "model/bundle.json").read_bytes()), Metadata)) == []
    wrong = report | {"verdict": "maybe", "effects": [{**report["effects"][0], "confidence": "98 %"}]}
    assert sorted(misfits(wrong, Report)) == ["report.effects.0.confidence", "report.verdict"]


def test_sets_to_try_out_refuse_what_cannot_be_simulated(tmp_path, monkeypatch):
    monkeypatch.setenv("ACQD_DATASETS", str(tmp_path / "kept"))
    for call, why in (
        (lambda: acqd.datasets.changed("nonsense:x=1"), "is unknown"),
        (lambda: acqd.datasets.reference("nosuch"), "is unknown"),
        (lambda: acqd.datasets.reference(recordings=1), "expected 2 or more"),
    ):
        with pytest.raises(acqd.UserError, match=why):
            call()
    assert acqd.datasets.folder() == tmp_path / "kept"
    assert not any(path.is_dir() for path in tmp_path.rglob("*-*"))


@pytest.mark.slow
def test_a_set_is_made_once(tmp_path, monkeypatch):
    monkeypatch.setenv("ACQD_DATASETS", str(tmp_path / "kept"))
    made = acqd.datasets.changed("payload:mass_kg=1.5", recordings=2)
    assert made.measured == "simulated" and made.robot == "iiwa7_r800" and len(made.recordings) == 2
    stamp = (made.path / "manifest.json").stat().st_mtime_ns
    assert acqd.datasets.changed("payload:mass_kg=1.5", recordings=2).path == made.path
    assert (made.path / "manifest.json").stat().st_mtime_ns == stamp
    acqd.datasets.clear()
    assert not any((tmp_path / "kept").iterdir())


def test_only_sets_that_were_made_are_cleared(tmp_path, monkeypatch):
    monkeypatch.setenv("ACQD_DATASETS", str(tmp_path))
    for name in ("iiwa7_r800-payload-0123456789ab", "thesis", "backup-0123456789ab"):
        (tmp_path / name / "ds").mkdir(parents=True)
    for name in ("iiwa7_r800-payload-0123456789ab", "thesis"):
        (tmp_path / name / "ds" / "manifest.json").write_text("{}")
    acqd.datasets.clear()
    assert {path.name for path in tmp_path.iterdir()} == {"thesis", "backup-0123456789ab"}
