"""Networks, grey boxes, bundles: against autograd, Pinocchio and independent expressions."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import InputError, UserError
from acqd.models.bundle.bundle import Bundle, load_bundle, save_bundle
from acqd.models.bundle.envelope import Envelope
from acqd.models.bundle.restore import open_model, restore
from acqd.models.compare.kernels import difference_of_gaussian, laplacian_of_gaussian, likeness, response
from acqd.models.compare.stability import unstable_share
from acqd.models.features import motion
from acqd.models.greybox.bundle_io import arrays_of, describe
from acqd.models.greybox.fit import fit_grey_box
from acqd.models.hybrid.model import Hybrid, Perceptron
from acqd.models.metrics import measure, predictions
from acqd.models.networks.architecture import ARCHITECTURES, architecture
from acqd.models.networks.batches import Batch, Example, batches
from acqd.models.networks.flat_parameters import initial
from acqd.models.networks.fused.compiled import INSTRUCTION_SETS, best_instruction_set
from acqd.models.networks.fused.engine import FusedEngine
from acqd.models.networks.predictor import NetworkPredictor
from acqd.models.networks.settings import TrainingSettings
from acqd.models.networks.torch_engine import TorchEngine
from acqd.models.networks.train import train
from acqd.models.noise_floor import noise_floor
from acqd.models.normalisation import Normalisation
from acqd.models.predictor import Stream
from acqd.models.segments import Dataset, Segment
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.dynamics import inertial_parameters, inverse_dynamics
from acqd.robot.newton_euler import Chain, joint_torque

STEP = 0.04


def angles(rows, axes, seed):
    """Smooth motion with standstill in it."""
    random = np.random.default_rng(seed)
    t = np.arange(rows) * STEP
    phases, rates = random.uniform(0, 6, (2, axes)), random.uniform(0.15, 0.5, (3, axes))
    q = 0.8 * np.sin(2 * np.pi * rates[0] * t[:, None] + phases[0]) + 0.4 * np.sin(
        4 * rates[1] * t[:, None] + phases[1]
    )
    q[: rows // 10] = q[rows // 10]
    return q


def segment(number, split, q, P, **more):
    return Segment(f"a_{number:02d}", f"a_{number:02d}", "a", split, q, P, more.get("tau"), more.get("signals", {}))


def dataset(make_power, count=16, rows=600, axes=7, **more):
    parts = ["validation" if k % 8 == 3 else "test" if k % 8 == 7 else "train" for k in range(count)]
    made = []
    for k, part in enumerate(parts):
        q = angles(rows + 13 * k, axes, k)
        made.append(segment(k, part, q, make_power(q, k), **{name: make(q) for name, make in more.items()}))
    return Dataset(Path("nowhere"), "0" * 64, "iiwa7_r800", "iiwa7_r800", STEP, "simulated", made)


def test_learnables_are_those_of_appendix_b():
    assert [a.learnables(7) for a in ARCHITECTURES.values()] == [903, 1183, 1463, 1191, 1475, 1481, 1499, 2133]


@pytest.mark.parametrize("robot", ["iiwa7_r800", "ur3e", "ur10e", "kinova_gen3"])
def test_newton_euler_agrees_with_pinocchio(robot):
    description = load_description(robot)
    arm = Arm(description)
    q, qd, qdd = np.random.default_rng(3).normal(0, 2, (3, 40, arm.axes))
    own = joint_torque(Chain.of(description), inertial_parameters(arm), q, qd, qdd)
    assert np.abs(own - inverse_dynamics(arm, q, qd, qdd)).max() < 1e-9


def usable(instructions):
    return instructions.lanes <= best_instruction_set().lanes


@pytest.mark.parametrize("name", list(ARCHITECTURES))
@pytest.mark.parametrize("instructions", INSTRUCTION_SETS, ids=lambda each: each.name)
def test_fused_gradients_are_those_of_autograd(name, instructions):
    if not usable(instructions):
        pytest.skip("this processor lacks them")
    chosen = architecture(name)
    for axes, count, rows in ((7, 11, 90), (6, 19, 33), (3, 1, 1)):
        random = np.random.default_rng(axes)
        theta = initial(chosen, axes, 1) + 0.1 * random.standard_normal(chosen.learnables(axes)).astype(np.float32)
        margin = 2 * chosen.radius if chosen.kernels else 0
        width = axes if chosen.kernels else chosen.width(axes)
        batch = Batch(
            random.standard_normal((count, rows + margin, width)).astype(np.float32),
            random.standard_normal((count, rows)).astype(np.float32),
        )
        reference, fused = TorchEngine(chosen, axes), FusedEngine(chosen, axes, instructions)
        prepared = reference.prepare(batch)
        loss, gradient = reference.gradient(theta, prepared)
        own_loss, own = fused.gradient(theta, fused.prepare(batch))
        assert own_loss == pytest.approx(loss, rel=1e-5)
        assert fused.loss(theta, fused.prepare(batch)) == pytest.approx(reference.loss(theta, prepared), rel=1e-5)
        assert np.abs(own - gradient).max() < 1e-5 * np.abs(gradient).max()


def test_saturated_gates_do_not_break_the_fused_path():
    chosen = architecture("21x1dim")
    theta = initial(chosen, 7, 1) * 200
    batch = Batch(np.ones((2, 20, 21), dtype=np.float32), np.zeros((2, 20), dtype=np.float32))
    reference, fused = TorchEngine(chosen, 7), FusedEngine(chosen, 7)
    loss, gradient = fused.gradient(theta, fused.prepare(batch))
    assert np.isfinite(loss) and np.isfinite(gradient).all()
    assert loss == pytest.approx(reference.loss(theta, reference.prepare(batch)), rel=1e-4)


@given(st.lists(st.integers(1, 60), min_size=1, max_size=40), st.integers(1, 12), st.sampled_from([0, 2, 20]))
def test_batches_are_sorted_and_truncated_to_their_shortest(lengths, size, margin):
    examples = [
        Example(np.full((n + margin, 2), k, np.float32), np.full(n, k, np.float32)) for k, n in enumerate(lengths)
    ]
    made = batches(examples, size, margin)
    assert sum(len(batch.target) for batch in made) == len(lengths)
    shortest = [batch.target.shape[1] for batch in made]
    assert shortest == sorted(shortest) and shortest == sorted(lengths)[::size]
    assert all(batch.inputs.shape[1] == batch.target.shape[1] + margin for batch in made)
    assert all((batch.inputs[:, 0, 0] == batch.target[:, 0]).all() for batch in made)


@given(st.floats(-3, 3), st.floats(-2, 2), st.floats(-5, 5))
def test_differences_are_exact_for_parabolas(a, b, c):
    t = np.arange(20) * STEP
    _, qd, qdd = motion((a + b * t + c * t**2)[:, None], STEP)
    assert np.allclose(qd[1:-1, 0], (b + 2 * c * t)[1:-1], atol=1e-9)
    assert np.allclose(qdd[1:-1, 0], 2 * c, atol=1e-7)


def streamed(model, q, signals=None):
    stream = Stream(model)
    each = [stream.step(row, None if signals is None else signals[k]) for k, row in enumerate(q)]
    return np.array([value for value in each if value is not None] + stream.finish())


@settings(deadline=None)
@given(st.sampled_from(list(ARCHITECTURES)), st.integers(1, 70), st.sampled_from([3, 6, 7]), st.integers(0, 9))
def test_step_by_step_equals_the_whole_sequence(name, rows, axes, seed):
    chosen = architecture(name)
    normal = Normalisation.thesis(axes)
    theta = initial(chosen, axes, seed)
    model = NetworkPredictor(chosen, axes, STEP, theta, normal)
    q = np.random.default_rng(seed).normal(0, 1, (rows, axes))
    assert np.abs(streamed(model, q) - model.sequence(q)).max() < 1e-6
    with torch.no_grad():  # and both are what was trained
        engine = TorchEngine(chosen, axes)
        engine._load(theta)
        from acqd.models.networks.predictor import example_inputs

        inputs = torch.from_numpy(example_inputs(chosen, normal, q, STEP)[None])
        trained = engine._network(inputs).numpy()[0] * normal.P_scale + normal.P_offset
    assert np.abs(model.sequence(q) - trained).max() < 1e-2


def iiwa_power(q, seed=None):
    """Another expression of a robot's power: Pinocchio, straight signs, a lag by Euler's rule in tenths of a step."""
    description = load_description("iiwa7_r800")
    _, qd, qdd = motion(q, STEP)
    tau = 1.04 * inverse_dynamics(Arm(description), q, qd, qdd)
    motor = tau + 2.0 * qdd + 6.0 * np.sign(qd) + 8.0 * qd
    now = 150 + 1.06 * (motor * qd).sum(axis=1) + 0.0025 * (motor**2).sum(axis=1)
    fine = np.repeat(now, 10)
    out = np.empty_like(fine)
    value = fine[0]
    for k, target in enumerate(fine):
        value += (target - value) * (STEP / 10) / 0.02
        out[k] = value
    P = out.reshape(-1, 10).mean(axis=1)
    noise = np.zeros(len(q)) if seed is None else np.random.default_rng(seed).normal(0, 0.5, len(q))
    return P + noise


@pytest.fixture(scope="module")
def grey():
    data = dataset(iiwa_power)
    return data, fit_grey_box(load_description("iiwa7_r800"), data.part("train"), STEP, 1, lambda share: None)


def test_the_grey_box_recovers_what_made_the_data(grey):
    data, fit = grey
    test = data.part("test")
    assert measure(predictions(fit.model, test), test).mae < 1.0
    viscous, coulomb = fit.model.group("viscous"), fit.model.group("coulomb")
    assert np.median(viscous) == pytest.approx(8.0, rel=0.1) and np.median(coulomb) == pytest.approx(6.0, rel=0.15)
    assert fit.model.group("standby")[0] == pytest.approx(150, abs=1.5)
    names = [name for name, _ in fit.model.layout.names()]
    half = 1.96 * np.sqrt(np.diag(fit.covariance))
    k = names.index("viscous.joint2")
    assert 0.01 < half[k] < 4
    unseen = names.index("m.link1")  # mass of the link that only turns about the vertical: no power tells of it
    assert half[unseen] > 0.2 * fit.model.values[unseen]


def test_the_terms_of_a_grey_box_add_up_and_stream(grey):
    data, fit = grey
    q = data.segments[0].q
    from acqd.models.features import padded

    none = np.zeros((len(q), 0))
    terms = fit.model.terms(padded(q, 1), none)
    assert np.allclose(sum(terms.values()), fit.model.sequence(q), atol=1e-9)
    assert np.abs(streamed(fit.model, q) - fit.model.sequence(q)).max() < 1e-6
    network = Perceptron(*(np.random.default_rng(1).normal(size=shape) for shape in ((12, 21), (12,), (12,))))
    hybrid = Hybrid(fit.model, network, Normalisation.fitted(data.segments, STEP))
    assert np.abs(streamed(hybrid, q) - hybrid.sequence(q)).max() < 1e-6


def test_torques_that_were_logged_fix_the_scale():
    description = load_description("iiwa7_r800")

    def torque(q):
        return 1.04 * inverse_dynamics(Arm(description), *motion(q, STEP))

    data = dataset(iiwa_power, tau=torque)
    fit = fit_grey_box(description, data.part("train"), STEP, 1, lambda share: None)
    assert fit.model.group("gain")[0] == pytest.approx(1.06, abs=0.01)


def small(data, tmp_path, epochs, checkpoint="c", **options):
    chosen = TrainingSettings(epochs=epochs, validation_every=3, **options)
    return train(architecture("14x1dim"), data, (), 5, chosen, tmp_path / checkpoint, lambda at: None)


def test_training_learns_and_goes_on_after_it_was_stopped(tmp_path, monkeypatch):
    data = dataset(iiwa_power, count=8, rows=200)
    seen = data.part("train")
    P = np.concatenate([s.P for s in seen])
    chosen = TrainingSettings(epochs=200)
    learnt = train(
        architecture("14x1dim"),
        replace(data, segments=[*seen, *(replace(s, split="validation") for s in seen)]),
        (),
        5,
        chosen,
        tmp_path / "learnt",
        lambda at: None,
    )
    assert measure(predictions(learnt.predictor, seen), seen).mae < 0.5 * np.abs(P - P.mean()).mean()
    whole = small(data, tmp_path, 30)
    monkeypatch.setattr("acqd.models.networks.train._SAVE_EVERY_S", 0.0)

    class StoppedError(Exception):
        pass

    def stop(at):
        if at.epoch == 11:
            raise StoppedError

    settings_ = TrainingSettings(epochs=30, validation_every=3)
    with pytest.raises(StoppedError):
        train(architecture("14x1dim"), data, (), 5, settings_, tmp_path / "again", stop)
    assert (tmp_path / "again").exists()
    begun = []
    resumed = train(
        architecture("14x1dim"), data, (), 5, settings_, tmp_path / "again", lambda at: begun.append(at.epoch)
    )
    assert begun[0] == 11  # the tenth was saved
    assert np.array_equal(resumed.parameters, whole.parameters) and resumed.run.best_loss == whole.run.best_loss


def test_torch_trains_to_the_same_place(tmp_path):
    data = dataset(iiwa_power, count=8, rows=120)
    fused, portable = (small(data, tmp_path, 4, name, compute=name) for name in ("fused", "torch"))
    assert "torch" in portable.engine and "fused" in fused.engine
    assert np.abs(fused.parameters - portable.parameters).max() < 2e-3


def test_patience_stops_and_keeps_the_best(tmp_path):
    data = dataset(iiwa_power, count=8, rows=120)
    early = small(data, tmp_path, 2000, patience=5)
    assert early.run.epoch < 2000
    assert early.run.best_loss == min(loss for _, _, loss in early.run.history)


def test_a_bundle_brings_back_the_model_and_says_what_is_wrong_with_it(grey, tmp_path):
    data, fit = grey
    about = {"kind": "grey_box", "axes": 7, "step_s": STEP, **describe(fit)}
    save_bundle(tmp_path / "b", Bundle(about, arrays_of(fit.model)))
    _, again = open_model(tmp_path / "b")
    q = data.segments[0].q
    assert np.array_equal(again.sequence(q), fit.model.sequence(q))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b"]
    assert {path.name for path in (tmp_path / "b").iterdir()} == {"bundle.json", "weights.safetensors"}
    save_bundle(tmp_path / "b", Bundle(about | {"name": "newer"}, arrays_of(fit.model)))
    assert load_bundle(tmp_path / "b").metadata["name"] == "newer"
    with pytest.raises(InputError, match="no bundle"):
        load_bundle(tmp_path)
    file = tmp_path / "b" / "bundle.json"
    good = file.read_text()
    for text, match in (
        (good[:-20], "damaged"),
        (good.replace('"format": 1', '"format": 9'), "another format"),
        (good.replace("grey_box", "transformer"), "unknown kind"),
        (good.replace('"axes": 7', '"axes": 6'), "hold"),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=match):
            open_model(tmp_path / "b")
    file.write_text(good)
    (tmp_path / "b" / "weights.safetensors").write_bytes(b"\x80\x04pickle")
    with pytest.raises(InputError, match="weights"):
        load_bundle(tmp_path / "b")


def test_a_network_with_other_learnables_is_refused():
    about = {
        "kind": "network",
        "axes": 7,
        "step_s": STEP,
        "architecture": {"name": "21x1dim"},
        "normalisation": Normalisation.thesis(7).as_json(),
    }
    with pytest.raises(UserError, match="1463"):
        restore(Bundle(about, {"theta": np.zeros(1462, np.float32)}))
    with pytest.raises(UserError, match="22x1dim"):
        restore(Bundle(about | {"architecture": {"name": "22x1dim"}}, {"theta": np.zeros(1463, np.float32)}))


def test_motion_beyond_training_is_flagged():
    data = dataset(lambda q, k: np.full(len(q), 100.0), count=8, rows=100)
    envelope = Envelope.from_json(Envelope.of(data.segments, STEP).as_json())
    assert not any(envelope.outside(s.q, STEP).any() for s in data.segments)
    far = data.segments[0].q.copy()
    far[50] += 3.0
    assert envelope.outside(far, STEP)[50] and not envelope.outside(far, STEP)[:45].any()


def test_known_kernels_are_recognised():
    assert np.allclose(difference_of_gaussian(3), np.array([-1, 0, 1]) / np.sqrt(2))
    assert np.allclose(laplacian_of_gaussian(3), np.array([1, -2, 1]) / np.sqrt(6))
    for length in (3, 5, 11, 21):
        first, second = difference_of_gaussian(length), laplacian_of_gaussian(length)
        assert abs(first @ second) < 1e-12
        assert likeness(-3 * first).name == "velocity" and likeness(second).name == "acceleration"
        assert likeness(np.ones(length)).name == "angle"
        assert response(first, STEP)[1][0] < 1e-12  # no response to standstill
    f, magnitude = response(np.array([-0.5, 0.0, 0.5]) / STEP, STEP)
    assert magnitude[10] == pytest.approx(np.sin(2 * np.pi * f[10] * STEP) / STEP)


def test_oscillation_and_noise_are_told_apart():
    q = angles(600, 7, 1)
    P = iiwa_power(q, seed=2)
    one = segment(1, "test", q, P)
    assert unstable_share([P + 0.5], [one]) == 0.0
    wild = P.copy()
    wild[300:400] += 15 * (-1.0) ** np.arange(100)
    assert unstable_share([wild], [one]) == pytest.approx(100 / 600, abs=0.03)
    still = replace(one, q=np.zeros_like(q), P=200 + np.random.default_rng(1).normal(0, 2.0, 600))
    floor, where = noise_floor([still], STEP)
    assert floor == pytest.approx(2.0, rel=0.1) and where == "at rest, within two seconds"
    assert json.loads(json.dumps(measure([P], [one]).as_json()))["mae"] == 0.0


def test_a_stream_copies_what_it_is_given(grey):
    data, fit = grey
    q = data.segments[0].q[:50]
    stream, buffer, each = Stream(fit.model), np.empty(7), []
    for row in q:
        buffer[:] = row
        each.append(stream.step(buffer))
    each = [value for value in each if value is not None] + stream.finish()
    assert np.abs(each - fit.model.sequence(q)).max() < 1e-6
    assert Stream(fit.model).finish() == []


def test_nothing_that_is_no_bundle_is_replaced(tmp_path):
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter1.tex").write_text("x")
    for place in ("thesis", "thesis/chapter1.tex", "thesis/chapter1.tex/below"):
        with pytest.raises(UserError, match="choose another"):
            save_bundle(tmp_path / place, Bundle({}, {}))
    assert (tmp_path / "thesis" / "chapter1.tex").read_text() == "x"


def test_bias_counts_against_r2():
    P = np.random.default_rng(1).normal(100, 5, 400)
    one = segment(1, "test", np.zeros((400, 7)), P)
    assert measure([P], [one]).r2 == 1.0 and measure([P + 30], [one]).r2 < -20
