"""Mains of any nominal voltage: a bundle, its prediction row by row, and its FMU agree."""

import numpy as np
import pytest

from acqd.fmu.package import export_fmu
from acqd.fmu.variables import left_out
from acqd.models.augmented import Term
from acqd.models.bundle.bundle import save_bundle
from acqd.models.bundle.restore import open_model
from acqd.models.effects import library
from acqd.models.effects.scene import scene_of
from acqd.models.predictor import Stream
from tests.builders import grey, grey_bundle
from tests.fmu.importer import Unit, play, recording


def bundle(shape):
    """A share of all loads follows the voltage, and so does a constant load."""
    exponent, power = ({"value": value, "unit": unit, "ci95": None} for value, unit in ((1.5, "-"), (40.0, "W")))
    terms = [
        Term("line_voltage", "all loads", shape, (0,), np.array([1.5]), {"exponent": exponent}),
        Term("line_voltage", "a constant load", shape, (1,), np.array([40.0]), {"power": power}),
    ]
    made = grey_bundle()
    made.metadata["effects"] = [each.as_json() for each in terms]
    return made


@pytest.mark.parametrize("nominal", [120.0, 400.0])  # the FMU of every effect (test_simulation) has 230 V
def test_bundle_row_by_row_and_fmu_agree(tmp_path, nominal):
    save_bundle(tmp_path / "bundle", bundle({"nominal_V": nominal}))
    _, model = open_model(tmp_path / "bundle")
    q, signals = recording(300)
    signals["Vrms"] = nominal * (1 + 0.05 * np.sin(np.arange(300) / 40) + np.linspace(-0.05, 0.05, 300))
    columns = np.column_stack([signals[name] for name in model.signals])
    whole = model.sequence(q, columns)
    base = grey().sequence(q, columns[:, :1])
    assert 1.0 < np.abs(whole - base).max() < 60.0  # relative to the nominal voltage, not to another one
    stream = Stream(model)
    rows = [stream.step(*row) for row in zip(q, columns, strict=True)]
    rows = [row for row in rows if row is not None] + stream.finish()
    np.testing.assert_allclose(rows, whole, atol=1e-6)
    export_fmu(tmp_path / "bundle", tmp_path / "power.fmu", "2.0", ["linux64"], lambda _: None)
    unit = Unit(tmp_path / "power.fmu", tmp_path / "fmu")
    simulated = play(unit, model, q, signals)
    unit.close()
    np.testing.assert_allclose(simulated[model.radius :, 0], whole[: len(q) - model.radius], atol=1e-6)
    assert model.usual_signals()[model.signals.index("Vrms")] == nominal


@pytest.mark.parametrize(
    ("volts", "nominal"), [(117.0, 120.0), (101.0, 100.0), (208.0, 230.0), (244.0, 230.0), (395.0, 400.0)]
)
def test_the_loop_keeps_the_nominal_voltage_of_the_recordings(volts, nominal):
    q, signals = recording(100)
    scene = scene_of(grey(), q, {"brake": signals["brake"]}, 0.0, {"Vrms": np.full(100, volts)})
    assert library()["line_voltage"].fixed_shape([scene]) == {"nominal_V": nominal}


def test_recordings_between_two_nominal_voltages_share_one_of_them():
    q, signals = recording(100)
    volts = (109.2, 109.6, 110.0)
    scenes = [scene_of(grey(), q, {"brake": signals["brake"]}, 0.0, {"Vrms": np.full(100, v)}) for v in volts]
    effect = library()["line_voltage"]
    for scene in scenes:
        scene.memory.update(effect.fixed_shape(scenes))
    relative = [effect.at(scene, {})[0, 1] + 1 for scene in scenes]
    assert np.ptp(np.array(volts) / relative) < 1e-9


def test_an_older_bundle_without_the_nominal_voltage_is_exported_with_a_word(tmp_path):
    save_bundle(tmp_path / "bundle", bundle({}))
    _, model = open_model(tmp_path / "bundle")
    assert ["230 V is assumed" in note for note in left_out(model)] == [True]
