"""FMUs through an independent importer (fmpy): the numbers, the clock, the state, the rules."""

import re

import numpy as np
import pytest

from acqd.models.augmented import Augmented
from tests.builders import STEP
from tests.fmu.bundles import KINDS
from tests.fmu.importer import Unit, expected, inputs, play, recording


@pytest.mark.parametrize(
    ("kind", "version"),
    [*((kind, "2.0") for kind in KINDS), *((kind, "3.0") for kind in ("5conv1x21", "effects", "hybrid"))],
)
def test_an_fmu_gives_the_power_of_its_bundle(made, tmp_path, kind, version):
    model, file = made(kind, version)
    q, signals = recording()
    unit = Unit(file, tmp_path)
    found = play(unit, model, q, signals)
    unit.close()
    late = model.radius
    wanted = expected(model, q, signals)[: len(q) - late]
    np.testing.assert_allclose(found[late:, 0], wanted, atol=1e-5)
    np.testing.assert_allclose(found[late:, 1], np.cumsum(wanted) * STEP / 3.6e6, rtol=1e-9)
    assert file.stat().st_size < 200_000


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("kind", ["21x1dim", "effects"])
def test_any_step_size_gives_the_same_rows(made, tmp_path, kind, version):
    model, file = made(kind, version)
    q, signals = recording(120)
    unit = Unit(file, tmp_path)
    whole = play(unit, model, q, signals)
    fine = Unit(file, tmp_path)
    for row in range(len(q)):
        fine.set(**inputs(model, q, signals, row))
        for _ in range(4):
            fine.step(STEP / 4)
        assert fine.get("power", "energy") == pytest.approx(whole[row], abs=0)
    held, once = Unit(file, tmp_path), Unit(file, tmp_path)
    for unit_ in (held, once):
        unit_.set(**inputs(model, q, signals, 50))
    for _ in range(10):
        held.step()
    once.step(10 * STEP)
    assert once.get("power", "energy") == held.get("power", "energy")
    before = held.get("power")
    held.step()  # inputs hold: the model goes on nevertheless
    assert held.get("energy")[0] > once.get("energy")[0]
    assert kind != "21x1dim" or held.get("power") != before


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("kind", ["5conv1x21", "effects"])
def test_a_state_comes_back_exactly_in_another_instance(made, tmp_path, kind, version):
    model, file = made(kind, version)
    q, signals = recording(160)
    one = Unit(file, tmp_path)
    play(one, model, q, signals, range(80))
    unit = one.unit
    get, put = (unit.getFMUstate, unit.setFMUstate) if one.two else (unit.getFMUState, unit.setFMUState)
    state = get()
    serial = (unit.serializeFMUstate if one.two else unit.serializeFMUState)(state)
    first = play(one, model, q, signals, range(80, 160))
    put(state)
    one.time = 80 * STEP
    np.testing.assert_array_equal(play(one, model, q, signals, range(80, 160)), first)
    other = Unit(file, tmp_path)
    restored = (other.unit.deSerializeFMUstate if one.two else other.unit.deserializeFMUState)(serial)
    (other.unit.setFMUstate if one.two else other.unit.setFMUState)(restored)
    other.time = 80 * STEP
    np.testing.assert_array_equal(play(other, model, q, signals, range(80, 160)), first)
    damaged = bytearray(serial)
    damaged[200] ^= 1
    with pytest.raises(Exception, match=r"[sS]erialize"):
        (other.unit.deSerializeFMUstate if one.two else other.unit.deserializeFMUState)(bytes(damaged))


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_reset_begins_anew_by_input_and_by_function(made, tmp_path, version):
    model, file = made("effects", version)
    q, signals = recording(90)
    unit = Unit(file, tmp_path)
    first = play(unit, model, q, signals)
    unit.set(reset=True, **inputs(model, q, signals, 0))
    unit.step()
    unit.set(reset=False)
    again = play(unit, model, q, signals, range(1, 90))
    np.testing.assert_array_equal(again, first[1:])
    unit.unit.reset()
    unit.begin()
    np.testing.assert_array_equal(play(unit, model, q, signals), first)


def test_parameters_of_effects_can_be_tuned(made, tmp_path):
    model, file = made("network_with_effects")
    q, signals = recording(90)
    unit = Unit(file, tmp_path)
    names = [v.name for v in unit.description.modelVariables if v.causality == "parameter"]
    assert "payload.p0_as_0_20_ms" in names
    assert all(re.fullmatch(r"[a-z_0-9]+\.[A-Za-z_0-9]+", name) for name in names)
    unit.set(**dict.fromkeys(names, 0.0))
    bare = Augmented(model.base, model.carrier, [])
    late = model.radius
    found = play(unit, model, q, signals)
    np.testing.assert_allclose(found[late:, 0], bare.base.sequence(q)[: len(q) - late], atol=1e-5)


def test_it_refuses_what_the_standard_forbids(made, tmp_path):
    _, file = made("grey_box")
    unit = Unit(file, tmp_path)
    with pytest.raises(Exception, match="fmi2SetReal"):
        unit.unit.setReal([unit.references["power"]], [1.0])
    with pytest.raises(Exception, match="fmi2SetReal"):
        unit.set(q1=float("nan"))
    with pytest.raises(Exception, match="fmi2DoStep"):
        unit.unit.doStep(5.0, STEP)
    with pytest.raises(Exception, match="fmi2DoStep"):
        unit.unit.doStep(0.0, -STEP)
