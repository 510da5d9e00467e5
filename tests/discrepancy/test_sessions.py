"""Recordings in question from several sessions."""

import pytest

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.recordings import subject_of
from acqd.errors import UserError
from acqd.models.augmented import Term
from tests.builders import recording, write_dataset


def test_recordings_of_a_later_session_join_those_in_question_and_begin_on_their_own(closed, tmp_path, model):
    folder, _ = closed
    later = [recording(model, k, seed=9, rows=700, start_s=1e9 + 9e5) for k in range(4)]
    more = write_dataset(tmp_path / "later", later)
    config = CloseConfig(folder / "now" / "ds", folder / "model", tmp_path / "out", further=(more,))
    subject = subject_of(config, lambda *_: None)
    everything = [*subject.fit, *subject.held_out]
    begins = subject.begins
    assert len(begins) == 2 and max(begins.values()) - min(begins.values()) > 8e5
    assert len({segment.recording for segment in everything}) == 13
    assert CloseConfig.from_json(config.as_json(), config.out) == config


def test_recordings_that_the_model_was_trained_on_are_left_out_with_a_note(closed, tmp_path, model):
    folder, _ = closed
    other = write_dataset(tmp_path / "other", [recording(model, k, seed=8, start_s=2e9) for k in range(4)])
    further = (folder / "before" / "ds",)
    config = CloseConfig(folder / "now" / "ds", folder / "model", tmp_path / "out", other, further=further)
    notes = subject_of(config, lambda *_: None).notes
    assert any("8 of 9 recordings of" in note and "left out" in note for note in notes)


def test_recordings_of_the_reference_are_not_in_question(closed, tmp_path):
    folder, _ = closed
    config = CloseConfig(folder / "now" / "ds", folder / "model", tmp_path, further=(folder / "before" / "ds",))
    with pytest.raises(UserError, match="or its reference holds them; name those made since"):
        subject_of(config, lambda *_: None)


def test_a_term_knows_the_start_of_every_session():
    term = Term("thermal_friction", "joint 1", {"origin_s": 100.0, "origin_s_1": 900.0}, (0,), [1.0], {})
    assert [term.session_start(at) for at in (50.0, 100.0, 899.0, 900.0, 5e3)] == [100.0, 100.0, 100.0, 900.0, 900.0]
    assert Term("payload", "flange", {}, (0,), [1.0], {}).session_start(1.0) is None
