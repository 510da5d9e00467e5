"""Models with effects added: on disk, row by row, without a term."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.models.augmented import Augmented, Term
from acqd.models.bundle.bundle import Bundle, save_bundle
from acqd.models.bundle.reference import load_reference, reference_arrays
from acqd.models.bundle.restore import open_model
from acqd.models.effects.scene import scene_of
from acqd.models.features import padded
from acqd.models.greybox.bundle_io import arrays_of
from acqd.models.predictor import Stream
from tests.builders import STEP, grey_bundle, recording, term


def test_augmented_models_come_back_from_disk_and_forget_on_request(model, tmp_path):
    terms = [term("payload", {"centre_of_mass_m": 0.05}), term("brake_holding"), term("line_voltage")]
    about = {"kind": "grey_box", "axes": 6, "step_s": STEP, "signals": ["brake"], "inputs": []}
    reference = reference_arrays([recording(model, k, seed=1) for k in range(3)])
    bundle = Bundle(about | {"effects": [each.as_json() for each in terms]}, arrays_of(model), reference)
    save_bundle(tmp_path / "b", bundle)
    _, opened = open_model(tmp_path / "b")
    assert isinstance(opened, Augmented) and opened.signals == ("brake", "Vrms")
    segment = recording(model, 1, seed=5)
    signals = np.column_stack([segment.signals["brake"], segment.channels["Vrms"]])
    scene = scene_of(model, segment.q, segment.signals, segment.start_s, segment.channels)
    expected = sum(t.rows(scene) for t in terms)
    base = model.sequence(segment.q, signals[:, :1])
    assert np.abs(opened.sequence(segment.q, signals) - base - expected).max() < 1e-9
    rest = opened.without("payload")
    assert [each.id for each in rest.terms] == ["brake_holding", "line_voltage"]
    remembered = load_reference(tmp_path / "b")
    assert [each.recording for each in remembered] == ["r_1_00", "r_1_01", "r_1_02"]
    assert np.abs(remembered[2].P - recording(model, 2, seed=1).P).max() < 1e-4
    save_bundle(tmp_path / "forgetful", replace(bundle, reference=None))
    assert load_reference(tmp_path / "forgetful") == []


def test_a_bundle_without_the_recordings_that_it_was_written_with_says_so(model, tmp_path):
    for k in range(2):
        save_bundle(tmp_path / f"b{k}", grey_bundle(reference_arrays([recording(model, k, seed=1)])))
    lost, other = (tmp_path / f"b{k}" / "reference.safetensors" for k in range(2))
    other.replace(lost)
    with pytest.raises(InputError, match="does not match the hash"):
        load_reference(lost.parent)
    lost.unlink()
    with pytest.raises(InputError, match="safetensors: is missing"):
        load_reference(lost.parent)


def test_row_by_row_is_the_whole_recording(model):
    terms = [term("coulomb_friction"), term("tool_actuation"), term("payload", {"centre_of_mass_m": 0.1})]
    augmented = Augmented(model, model, terms)
    segment = recording(model, 0, rows=300)
    signals = np.column_stack([segment.signals[name] for name in augmented.signals])
    whole = augmented.sequence(segment.q, signals)
    stream = Stream(augmented)
    rows = [stream.step(q, s) for q, s in zip(segment.q, signals, strict=True)]
    rows = [row for row in rows if row is not None] + stream.finish()
    assert np.abs(np.array(rows) - whole).max() < 1e-6


def test_an_effect_that_began_later_does_not_act_before(model):
    later = term("brake_holding", {"begin_s": 1e9 + 20.0})
    segment = recording(model, 0, rows=1000)
    signals = np.ones((1000, 1))
    with_effect = Augmented(model, model, [later]).sequence(segment.q, signals, 1e9)
    change = with_effect - model.sequence(segment.q, signals)
    assert np.abs(change[:499]).max() < 1e-9 and np.abs(change[510:] - 2.0).max() < 1e-6


def test_effects_without_their_carrier_are_refused(tmp_path, model):
    with pytest.raises(ValueError, match="unknown to this version"):
        Term.from_json(term("payload").as_json() | {"id": "magic"})
    assert padded(np.zeros((3, 2)), 2).shape == (7, 2)
    with pytest.raises(UserError):
        Path(tmp_path, "x").write_text("")
        save_bundle(tmp_path / "x", Bundle({}, {}))
