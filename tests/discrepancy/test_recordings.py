"""Which recordings a model was fitted on, by content, or by name in bundles of before; which are held out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acqd.discrepancy.recordings import _hold_out, _unmoved_joints, is_training_dataset, trained_recordings
from acqd.models.segments import Dataset, Segment


def recording(name, content):
    return Segment(name, name, "r", "train", np.zeros((9, 6)), np.zeros(9), None, {}, content=content)


DATA = Dataset(Path("ds"), "digest", "ur3e", "ur3e", 0.04, "mains", [recording(n, c) for n, c in ("aA", "bB", "cC")])
NEW = {"manifest_sha256": "digest", "dataset_content": DATA.content, "seen_content": ["A", "B"],
       "fit_recordings": ["a"], "validation_recordings": ["b"]}  # fmt: skip
OLD = {key: value for key, value in NEW.items() if "content" not in key}


def test_content_decides_whatever_the_names_and_the_file():
    renamed = replace(DATA, digest="rebuilt", segments=[recording("x" + s.recording, s.content) for s in DATA.segments])
    for data in (DATA, renamed):
        assert is_training_dataset(NEW, data) and trained_recordings(NEW, data) == {"A", "B"}
    grown = replace(DATA, digest="grown", segments=[*DATA.segments, recording("a", "D")])
    assert not is_training_dataset(NEW, grown) and trained_recordings(NEW, grown) == {"A", "B"}
    named_alike = replace(DATA, digest="other", segments=[recording(s.recording, "new") for s in DATA.segments])
    assert not is_training_dataset(NEW, named_alike) and trained_recordings(NEW, named_alike) == set()


def test_a_bundle_of_before_knows_names_in_its_own_dataset():
    assert trained_recordings(OLD, DATA) == {"A", "B"} and is_training_dataset(OLD, DATA)
    assert trained_recordings(OLD, replace(DATA, digest="other")) == set()


def test_the_last_fit_counts_as_well_as_the_training():
    closed = NEW | {"closed_manifest_sha256": "closed", "closed_dataset_content": "?", "closed_seen_content": ["C"]}
    assert trained_recordings(closed, DATA) == {"A", "B", "C"} and not is_training_dataset(closed, DATA)


def test_an_angle_that_never_changes_is_doubted_where_the_reference_has_it():
    moving = np.random.default_rng(1).normal(0, 1, (9, 6))
    stuck = moving.copy()
    stuck[:, 2] = 0.4
    reference = [replace(recording("r", "R"), q=moving)]
    (line,) = _unmoved_joints(replace(DATA, segments=[replace(DATA.segments[0], q=stuck)]), reference)
    assert line.startswith("q3: one angle in all rows in question")
    for side in (reference, []):
        assert _unmoved_joints(replace(DATA, segments=[replace(DATA.segments[0], q=moving)]), side) == []
    assert _unmoved_joints(replace(DATA, segments=[replace(DATA.segments[0], q=stuck)]), []) == []


@pytest.mark.parametrize("lengths", [(4, 1), (5, 1), (3, 1), (1, 7), (4, 1, 1), (5, 2, 4)])
def test_no_session_is_held_out_as_a_whole(lengths):
    sessions = [f"session {k}" for k, length in enumerate(lengths) for _ in range(length)]
    unseen = [replace(recording(f"r{k:02}", str(k)), start_s=float(k), session=own) for k, own in enumerate(sessions)]
    fit, held_out = _hold_out(unseen, unseen, same=False)
    assert {segment.session for segment in fit} == set(sessions)
    assert held_out and sorted(s.recording for s in [*fit, *held_out]) == [s.recording for s in unseen]


def test_sessions_of_one_recording_each_are_held_out_in_turn():
    unseen = [replace(recording(f"r{k:02}", str(k)), start_s=float(k), session=f"session {k}") for k in range(6)]
    fit, held_out = _hold_out(unseen, unseen, same=False)
    assert [segment.recording for segment in held_out] == ["r02"] and len(fit) == 5
