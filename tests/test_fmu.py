"""FMUs through an independent importer (fmpy): the numbers, the clock, the state, the rules, bad input."""

import json
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.fmu.package import export_fmu
from acqd.fmu.variables import exported_terms
from acqd.models.augmented import Augmented, Term
from acqd.models.bundle.bundle import Bundle, save_bundle
from acqd.models.bundle.restore import open_model
from acqd.models.effects import library
from acqd.models.effects.scene import make_scene
from acqd.models.features import padded
from acqd.models.greybox.bundle_io import arrays_of
from acqd.models.hybrid.model import Perceptron
from acqd.models.networks.architecture import ARCHITECTURES
from acqd.models.networks.flat_parameters import initial
from acqd.models.normalisation import Normalisation
from tests.at_hand import AXES, STEP, about, grey, grey_bundle

fmpy = pytest.importorskip("fmpy")
from fmpy.fmi2 import FMU2Slave  # noqa: E402
from fmpy.fmi3 import FMU3Slave  # noqa: E402

KINDS = [*ARCHITECTURES, "grey_box", "hybrid", "effects", "network_with_effects"]


def normal():
    random = np.random.default_rng(3)
    return Normalisation(random.normal(0, 0.2, (3, AXES)), random.uniform(0.8, 2.0, (3, AXES)), 180.0, 60.0)


def network_bundle(name):
    theta = initial(ARCHITECTURES[name], AXES, 1) + np.random.default_rng(2).normal(
        0, 0.05, ARCHITECTURES[name].learnables(AXES)
    ).astype(np.float32)
    return Bundle(about("network", architecture={"name": name}, normalisation=normal().as_json()), {"theta": theta})


def terms(model):
    """One term of every effect that the library can foresee or average, in every place that differs."""
    q = np.zeros((60, AXES)) + 0.1 * np.arange(60)[:, None] / 60
    scene = make_scene(model, padded(q, 2), {"brake": np.ones(60), "tool": np.ones(60)}, 0.0, np.full(60, 231.0))
    detected = {
        "gear_ripple": {"joint": 2.0, "periods_per_turn": 17.5},
        "thermostat": {"share_of_time": 0.4, "period_s": 100.0},
        "process_load": {"share_of_time": 0.2},
        "contact_force": {"share_of_time": 0.3},
    }
    random = np.random.default_rng(8)
    found = []
    for identity, effect in library().items():
        shape = detected.get(identity) or dict(effect.shapes[0])
        width = effect.at(scene, shape).shape[1]
        if identity in detected:
            found.append(term(identity, "somewhere", shape, tuple(range(width)), random.normal(0, 2, width), width))
            continue
        for place in effect.places(scene):
            count = len(place.parameters)
            theta = random.uniform(0.5, 1.5, count) * (1e-3 if identity in ("copper_loss", "clock_offset") else 1.0)
            weights = theta if place.mix is None else place.mix @ theta
            found.append(term(identity, place.where, shape, place.columns, weights, count, theta))
    return found


def term(identity, where, shape, columns, weights, count, theta=None):
    values = weights if theta is None else theta
    parameters = {f"p{k}, as 0-20 ms": {"value": float(values[k]), "unit": "W", "ci95": None} for k in range(count)}
    parameters |= {name: {"value": value, "unit": "-", "ci95": None} for name, value in shape.items()}
    return Term(identity, where, shape, columns, np.asarray(weights, dtype=float), parameters)


def make(kind, folder):
    path = folder / kind
    if kind in ARCHITECTURES:
        bundle = network_bundle(kind)
    elif kind == "network_with_effects":
        bundle = network_bundle("21x1dim")
        bundle.metadata["carrier"] = {"signals": ["brake"]}
        bundle.arrays.update({f"carrier.{name}": value for name, value in arrays_of(grey()).items()})
        bundle.metadata["effects"] = [
            each.as_json() for each in terms(grey()) if each.id in ("payload", "tool_actuation")
        ]
    else:
        bundle = grey_bundle()
        if kind == "hybrid":
            random = np.random.default_rng(4)
            network = Perceptron(
                random.normal(0, 0.3, (12, 3 * AXES)), random.normal(0, 0.3, 12), random.normal(0, 3, 12)
            )
            rest = {"rest_W": network.W, "rest_b": network.b, "rest_out": network.out}
            bundle = Bundle(
                about("hybrid", signals=["brake"], normalisation=normal().as_json()), arrays_of(grey()) | rest
            )
        if kind == "effects":
            bundle.metadata["effects"] = [each.as_json() for each in terms(grey())]
    save_bundle(path, bundle)
    return path


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Bundles and their FMUs, made when they are asked for."""
    folder, cache = tmp_path_factory.mktemp("fmu"), {}

    def get(kind, version="2.0"):
        if kind not in cache:
            cache[kind] = make(kind, folder)
        file = folder / f"{kind}-{version}.fmu"
        if not file.exists():
            export_fmu(cache[kind], file, version, ["linux64"], lambda _: None)
        return open_model(cache[kind])[1], file

    return get


def recording(rows=400, seed=1):
    """Angles, and what signals a model may ask for."""
    random = np.random.default_rng(seed)
    t = np.arange(rows) * STEP
    q = sum(a * np.sin(2 * np.pi * f * t[:, None] + p) for a, f, p in zip(
        random.uniform(0.2, 0.5, (3, AXES)), random.uniform(0.05, 0.4, (3, AXES)), random.uniform(0, 6, (3, AXES)),
        strict=True,
    ))  # fmt: skip
    brake = np.clip((np.arange(rows) - 30.3), 0, 1) * (np.arange(rows) < rows - 40)
    tool = ((np.arange(rows) // 70) % 2) * 1.0
    return q, {"brake": brake, "tool": tool, "Vrms": 230 + 3 * np.sin(t / 5)}


class Unit:
    """An instance in either version, through fmpy."""

    def __init__(self, file, folder, start=0.0):
        self.description = fmpy.read_model_description(str(file))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.folder = Path(folder)
        if not (self.folder / "binaries").exists():
            fmpy.extract(str(file), str(self.folder))
        self.two = self.description.fmiVersion == "2.0"
        common = {
            "guid": self.description.guid, "unzipDirectory": str(self.folder),
            "modelIdentifier": self.description.coSimulation.modelIdentifier, "instanceName": "one",
        }  # fmt: skip
        self.unit = FMU2Slave(**common) if self.two else FMU3Slave(**common)
        self.unit.instantiate()
        self.begin(start)

    def begin(self, start=0.0, **inputs):
        if self.two:
            self.unit.setupExperiment(startTime=start)
            self.unit.enterInitializationMode()
        else:
            self.unit.enterInitializationMode(startTime=start)
        self.set(**inputs)
        self.unit.exitInitializationMode()
        self.time = start

    def set(self, **inputs):
        reals = {self.references[name]: float(value) for name, value in inputs.items() if name != "reset"}
        put = self.unit.setReal if self.two else self.unit.setFloat64
        put(list(reals), list(reals.values()))
        if "reset" in inputs:
            (self.unit.setBoolean)([self.references["reset"]], [bool(inputs["reset"])])

    def step(self, seconds=STEP):
        if self.two:
            self.unit.doStep(self.time, seconds)
        else:
            self.unit.doStep(self.time, seconds)
        self.time += seconds

    def get(self, *names):
        take = self.unit.getReal if self.two else self.unit.getFloat64
        return take([self.references[name] for name in names])

    def close(self):
        self.unit.terminate()
        self.unit.freeInstance()


def inputs(model, q, signals, row):
    found = {f"q{k + 1}": q[row, k] for k in range(AXES)}
    return found | {name: signals[name][row] for name in model.signals}


def play(unit, model, q, signals, rows=None):
    """Power and energy after each step."""
    found = []
    for row in range(len(q)) if rows is None else rows:
        unit.set(**inputs(model, q, signals, row))
        unit.step()
        found.append(unit.get("power", "energy"))
    return np.array(found)


def expected(model, q, signals):
    columns = np.column_stack([np.zeros((len(q), 0)), *(signals[name] for name in model.signals)])
    if isinstance(model, Augmented):
        model = Augmented(model.base, model.carrier, exported_terms(model))
    return model.sequence(q, columns)


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


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_fmpy_finds_nothing_to_complain_of(made, version):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(made("effects", version)[1])) == []


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


def test_the_sources_alone_make_the_same_binary(made, tmp_path):
    """An importer on another platform compiles what is in the FMU and nothing else."""
    _, file = made("effects", "3.0")
    with zipfile.ZipFile(file) as archive:
        archive.extractall(tmp_path)
    folder = tmp_path / "sources"
    names = re.findall(r'SourceFile name="([^"]+)"', (folder / "buildDescription.xml").read_text())
    command = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-fPIC", "-shared"]
    done = subprocess.run(
        [*command, *names, "-o", "own.so", "-lm"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_bad_input_is_named_and_nothing_is_left(made, tmp_path, monkeypatch):
    made("grey_box")
    bundle = tmp_path / "b"
    save_bundle(bundle, grey_bundle())
    out = tmp_path / "x.fmu"
    with pytest.raises(UserError, match="no platform 'amiga'"):
        export_fmu(bundle, out, "2.0", ["amiga"], lambda _: None)
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="nothing was left behind"):
        export_fmu(bundle, tmp_path / "file" / "x.fmu", "2.0", ["linux64"], lambda _: None)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "file"))
    with pytest.raises(UserError, match="TMPDIR"):
        export_fmu(bundle, out, "2.0", ["linux64"], lambda _: None)
    monkeypatch.undo()
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("acqd.fmu.platforms.find_spec", lambda _: None)
    with pytest.raises(UserError, match="no C compiler found"):
        export_fmu(bundle, out, "2.0", ["linux64"], lambda _: None)
    with pytest.raises(UserError, match="needs zig"):
        export_fmu(bundle, out, "2.0", ["win64"], lambda _: None)
    assert not list(tmp_path.glob("*.fmu")) and not list(tmp_path.glob(".x*"))


@pytest.mark.parametrize(
    "name", ["chain_axis", "chain_rotation", "chain_tip", "chain_xyz", "usual_signals", "parameters"]
)
def test_arrays_of_a_wrong_shape_are_told(tmp_path, name):
    bundle = grey_bundle()
    bundle.arrays[name] = bundle.arrays[name][..., :-1]
    save_bundle(tmp_path / "b", bundle)
    with pytest.raises(InputError, match="does not hold what its kind of model needs"):
        open_model(tmp_path / "b")


def test_weights_and_steps_that_cannot_be_are_told(tmp_path):
    save_bundle(tmp_path / "b", grey_bundle(step_s=-1.0))
    with pytest.raises(InputError, match="a step of -1"):
        open_model(tmp_path / "b")
    save_bundle(tmp_path / "c", grey_bundle())
    weights = tmp_path / "c" / "weights.safetensors"
    damaged = bytearray(weights.read_bytes())
    damaged[-5] ^= 1  # still numbers
    weights.write_bytes(damaged)
    with pytest.raises(InputError, match="does not match the hash"):
        open_model(tmp_path / "c")


def test_the_command_as_a_user_has_it(made, tmp_path):
    bundle = tmp_path / "b"
    save_bundle(bundle, grey_bundle())
    acqd = Path(sys.executable).with_name("acqd")
    done = subprocess.run([acqd, "export-fmu", bundle, "--json"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outputs"] == ["power", "energy"]
    assert (tmp_path / "b.fmu").exists()
    about = json.loads((bundle / "bundle.json").read_text())
    for broken in (json.dumps(about | {"kind": "transformer"}), "{"):
        (bundle / "bundle.json").write_text(broken)
        done = subprocess.run([acqd, "export-fmu", bundle], capture_output=True, text=True, check=False)
        told = "'transformer'" if broken != "{" else "bundle.json"
        assert done.returncode == 2 and told in done.stderr and "Traceback" not in done.stderr
