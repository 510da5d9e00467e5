"""Sessions that begin after hours of work: the friction of cold gears has decayed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acqd.discrepancy.beforehand import like_reference
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.regression.setup import Comparison, set_up
from acqd.lab.effects import make_effects, parse_effect
from acqd.models.effects import library
from acqd.models.effects.scene import segment_scene
from acqd.models.segments import load_dataset
from acqd.motion.controller import RATE, Controller, Wait
from tests.builders import ROBOT, recording, write_dataset


def test_cold_friction_of_a_session_that_begins_warm_has_decayed_by_the_work_before(model):
    segment = recording(model, 0, rows=300)
    scene = segment_scene(model, segment)
    scene.memory |= {"origin_s": float(scene.t[0])}
    effect = library()["thermal_friction"]
    cold = effect.at(scene, {"minutes": 30.0})
    scene.memory |= {"worked_s": 7200.0}
    assert np.abs(cold).max() > 0
    assert effect.at(scene, {"minutes": 30.0}) == pytest.approx(cold * np.exp(-4.0))


def test_a_dataset_remembers_how_long_the_robot_had_worked(model, tmp_path):
    ds = write_dataset(tmp_path / "ds", [recording(model, k, rows=300) for k in range(2)])
    manifest = (ds / "manifest.json").read_text()
    (ds / "manifest.json").write_text(manifest.replace('"valid_s"', '"worked_min": 90, "valid_s"'))
    assert {segment.worked_s for segment in load_dataset(ds).segments} == {5400.0}


def test_the_laboratory_warms_gears_before_the_session_unless_they_become_cold_later():
    (warm,) = make_effects([parse_effect("thermal_friction:minutes=30")], [1])
    (later,) = make_effects([parse_effect("thermal_friction:minutes=30,from=2")], [1])
    for effect in (warm, later):
        effect.work(7200.0)
    assert (warm._warmth, later._warmth) == (pytest.approx(1 - np.exp(-4.0)), 0.0)


def test_a_motion_becomes_a_recording_with_the_signals_of_the_reference(model):
    reference = [replace(recording(model, 0, rows=300), signals={"brake": np.ones(300)})]
    motion = Controller(ROBOT, reference[0].q[0]).run([Wait(2.0)])
    planned = like_reference(reference, "a motion", motion, 0.04)
    assert len(planned.q) == round(len(motion) / RATE / 0.04) - 1 == len(planned.signals["brake"]) == len(planned.P)
    assert planned.recording == "a motion" and planned.tau is None


def test_a_report_finds_what_was_closed_from_another_folder(tmp_path, monkeypatch):
    (tmp_path / "work" / "ds").mkdir(parents=True)
    report = tmp_path / "work" / "ds.loop"
    report.mkdir()
    asked = CloseConfig(Path("work/ds"), Path("nowhere/model"), report).as_json()
    monkeypatch.chdir(tmp_path / "work")
    config = CloseConfig.from_json(asked, Path("ds.loop"))
    assert config.dataset.samefile("ds") and config.bundle == Path("nowhere/model")


@pytest.mark.parametrize(("worked_s", "warm", "shared"), [(0.0, 0, True), (3600.0, 0, False), (3600.0, 12, False)])
def test_gears_that_were_warm_in_the_reference_are_no_lack_that_both_sides_share(model, robot, worked_s, warm, shared):
    """Free on both sides, cold friction of new recordings would take up any friction that has changed since.

    A second session, which begins warm, changes nothing of that.
    """
    before = [replace(recording(model, k, rows=400, seed=1), worked_s=worked_s) for k in range(4)]
    now = [recording(model, k, rows=400, seed=2, start_s=1e9 + 5000) for k in range(4)]
    later = [recording(model, 4 + k, rows=100, seed=3, start_s=1e9 + 9000) for k in range(warm)]
    now += [replace(each, session="session 1", worked_s=7200.0) for each in later]
    setup = set_up(Comparison(model, robot, now, before, frozenset({"thermal_friction"}), frozenset()), lambda _: None)
    thermal = {index for each in setup.design.columns.candidates if each.id for index in each.indices.tolist()}
    assert bool(thermal & {column.index for column in setup.regression.columns}) == shared
