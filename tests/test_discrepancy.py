"""Closing the loop: effects against independent expressions, the statistics against chance, the commands as a user."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.monitor.watch import Watch
from acqd.discrepancy.regression.setup import prepare
from acqd.discrepancy.residual.delay import corrected, find_delay
from acqd.discrepancy.residual.quality import noise_floor, quality
from acqd.discrepancy.residual.whitening import Whitener, autocorrelation
from acqd.discrepancy.selection.detectors.candidates import detect, residuals_of
from acqd.discrepancy.selection.detectors.switching import rhythm, search
from acqd.discrepancy.selection.stepwise import Limits, trace
from acqd.errors import InputError, UserError
from acqd.models.augmented import Augmented, Term
from acqd.models.bundle.bundle import Bundle, load_bundle, save_bundle
from acqd.models.bundle.reference import load_reference, reference_arrays
from acqd.models.bundle.restore import open_model
from acqd.models.effects import library
from acqd.models.effects.scene import scene_of
from acqd.models.effects.substeps import SUBSTEPS, averaged, substep_motion
from acqd.models.features import padded
from acqd.models.greybox.bundle_io import arrays_of
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import Layout, prior
from acqd.models.predictor import Stream
from acqd.models.segments import Segment
from acqd.robot import load_description
from acqd.robot.arm import Arm, Payload
from acqd.robot.dynamics import gravity_torque, inertial_parameters, inverse_dynamics
from acqd.robot.newton_euler import Chain, frames, weight_torque

STEP = 0.04
DESIGN_IDS = {
    "offset_shift",
    "coulomb_friction",
    "viscous_friction",
    "stribeck_friction",
    "load_dependent_friction",
    "thermal_friction",
    "payload",
    "gravity_bias",
    "copper_loss",
    "mechanical_power",
    "regeneration_clipping",
    "brake_release",
    "brake_holding",
    "gear_ripple",
    "thermostat",
    "tool_actuation",
    "line_voltage",
    "supply_efficiency",
    "contact_force",
    "clock_offset",
    "clock_drift",
    "meter_gain",
    "meter_saturation",
    "process_load",
}


@pytest.fixture(scope="module")
def robot():
    return load_description("ur10e")


@pytest.fixture(scope="module")
def model(robot):
    """A grey box with drives as a small robot has them."""
    layout = Layout(robot.axes, ("brake",))
    values = prior(layout, robot, inertial_parameters(Arm(robot)), 120.0, STEP).mean.copy()
    values[layout.place("coulomb")] = 5.0
    values[layout.place("viscous")] = 6.0
    values[layout.place("signals")] = 4.0
    values[layout.place("lag")] = 0.012
    return GreyBox(Chain.of(robot), layout, values, STEP, np.ones(1))


def motion(rows, axes, seed):
    """Smooth motion with a rest at the begin and at the end."""
    random = np.random.default_rng(seed)
    t = np.arange(rows) * STEP
    q = np.zeros((rows, axes))
    for _ in range(3):
        rate, phase, size = random.uniform(0.05, 0.3, axes), random.uniform(0, 6, axes), random.uniform(0.2, 0.6, axes)
        q += size * np.sin(2 * np.pi * rate * t[:, None] + phase)
    start = rows // 8
    k = np.arange(rows)
    ease = np.clip(np.minimum(k - start, rows - 15 - k) / 60, 0, 1)[:, None]
    ease = ease**3 * (10 - 15 * ease + 6 * ease**2)
    return q[start] + ease * (q - q[start])


def recording(model, number, add=None, *, rows=700, seed=0, start_s=1e9):
    """What a meter would see: the model, coloured noise, and whatever `add` makes of the scene [T] (W)."""
    random = np.random.default_rng([seed, number])
    q = motion(rows, model.axes, 100 * seed + number)
    signals = {"brake": (np.arange(rows) > 25) * 1.0, "tool": ((np.arange(rows) // 150) % 2) * 1.0}
    volts = 230 + np.cumsum(random.normal(0, 0.05, rows))
    begin = start_s + 60.0 * number
    scene = scene_of(model, q, signals, begin, {"Vrms": volts})
    noise = lfilter([0.25], [1, -0.7], random.normal(0, 1, rows)) + random.normal(0, 0.2)
    P = scene.predicted + noise
    if add is not None:
        P = P + add(scene, random)
    name = f"r_{seed}_{number:02d}"
    return Segment(name, name, "r", "train", q, P, None, signals, begin, {"Vrms": volts})


def traced(model, robot, add, *, count=7, withheld=frozenset(), contrast=True, only=None):
    """The loop's heart on recordings with an effect, beside recordings without."""
    reference = [recording(model, k, seed=1) for k in range(count)] if contrast else []
    in_question = [recording(model, k, add, seed=2, start_s=1e9 + 5000) for k in range(count)]
    chosen = set(only or library())
    design, competing, gates = prepare(model, robot, in_question, reference, chosen, set(withheld), lambda _: None)
    return design, trace(design, competing, gates, Limits(), lambda _: None)


def lagged_mean(fine_power, lag_s=0.012, steps=40):
    """[T] rows of power [SUB T] by another way: 40 steps a row, first-order lag by exact exponentials."""
    finer = np.repeat(fine_power, steps // SUBSTEPS)
    keep = np.exp(-STEP / steps / lag_s)
    out, _ = lfilter([1 - keep], [1, -keep], finer, zi=[keep * finer[0]])
    return out.reshape(-1, steps).mean(axis=1)


def test_the_library_has_every_id_of_the_design():
    assert set(library()) == DESIGN_IDS
    for effect in library().values():
        assert effect.summary and effect.equation and effect.experiment
        assert set(effect.neighbours) <= DESIGN_IDS - {effect.id}


def test_fine_motion_is_that_of_a_smooth_curve():
    t = np.arange(-2, 52) * STEP
    fine_t = (np.arange(50 * SUBSTEPS) + 0.5) / SUBSTEPS * STEP - STEP / 2
    q, qd, qdd = substep_motion(np.sin(2 * t)[:, None], STEP)
    assert np.abs(q[:, 0] - np.sin(2 * fine_t)).max() < 1e-6
    assert np.abs(qd[:, 0] - 2 * np.cos(2 * fine_t)).max() < 1e-4
    assert np.abs(qdd[:, 0] + 4 * np.sin(2 * fine_t)).max() < 1e-3


@pytest.mark.parametrize("name", ["iiwa7_r800", "ur10e"])
def test_weights_on_links_are_pinocchios(name):
    description = load_description(name)
    q = np.random.default_rng(5).uniform(-2, 2, (30, description.axes))
    where = frames(Chain.of(description), q)
    heavy = gravity_torque(Arm(description, Payload(1.0)), q) - gravity_torque(Arm(description), q)
    tip = Chain.of(description).beyond_flange(0.0)
    assert np.abs(weight_torque(where, description.axes - 1, tip) - heavy).max() < 1e-9


# What each effect adds, written without the library's own expressions: from the scene's motion alone.
def extra_power(scene, torque):
    """W of a torque on top of the motors', exactly: mechanical, copper, conduction; [T] at the meter."""
    gain, copper, conduction = (scene.model.group(name) for name in ("gain", "copper", "conduction"))

    def power(tau):
        loss = (copper * tau**2 + conduction * (np.sqrt(tau**2 + 0.25) - 0.5)).sum(axis=1)
        return gain[0] * (tau * scene.qd).sum(axis=1) + loss

    return lagged_mean(power(scene.tau + torque) - power(scene.tau))


def column(scene, joint, values):
    found = np.zeros_like(scene.qd)
    found[:, joint] = values
    return found


def pulses(scene, random, low, high, gap):
    on = np.zeros(scene.rows)
    k = int(random.exponential(gap / STEP))
    while k < scene.rows:
        length = int(random.uniform(low, high) / STEP)
        on[k : k + length] = 1
        k += length + int(random.exponential(gap / STEP)) + 5
    return on


def added_payload(scene, random):
    arm = load_description("ur10e")
    more = inverse_dynamics(Arm(arm, Payload(2.0, (0, 0, 0.05))), scene.q, scene.qd, scene.qdd)
    return extra_power(scene, more - inverse_dynamics(Arm(arm), scene.q, scene.qd, scene.qdd))


def since_release(scene):
    rise = int(np.flatnonzero(np.diff(scene.signals["brake"]) > 0)[0]) + 1
    age = (np.arange(len(scene.q)) - rise) * STEP / SUBSTEPS
    return np.where(age >= 0, age, -0.001)


def thermostat(scene, random):
    return 6.0 * (((averaged(scene.t) + 13.0) % 47.0) < 20.0)


INDEPENDENT = {
    "coulomb_friction": lambda s, r: extra_power(s, column(s, 1, 4.0 * np.tanh(s.qd[:, 1] / 0.004))),
    "viscous_friction": lambda s, r: extra_power(s, column(s, 2, 8.0 * s.qd[:, 2])),
    "stribeck_friction": lambda s, r: extra_power(s, 6.0 * np.exp(-np.abs(s.qd / 0.15) ** 1.7) * np.tanh(s.qd / 0.01)),
    "load_dependent_friction": lambda s, r: extra_power(s, 0.15 * np.abs(s.tau_rigid) * np.tanh(s.qd / 0.004)),
    "thermal_friction": lambda s, r: extra_power(s, column(s, 0, 60 * s.qd[:, 0] * 2.0 ** (-(s.t - 1e9 - 5000) / 150))),
    "payload": added_payload,
    "gravity_bias": lambda s, r: extra_power(
        s, gravity_torque_of_link(s.q, 2, 3.0)
    ),
    "copper_loss": lambda s, r: lagged_mean(0.9 * (s.model.group("copper") * s.tau**2).sum(axis=1)),
    "mechanical_power": lambda s, r: lagged_mean(0.12 * np.abs(s.tau * s.qd).sum(axis=1)),
    "regeneration_clipping": lambda s, r: lagged_mean(0.9 * np.maximum(-s.drives, 0)),
    "brake_release": lambda s, r: lagged_mean(25.0 * (since_release(s) >= 0) * np.exp(-since_release(s) / 0.15)),
    "brake_holding": lambda s, r: lagged_mean(5.0 * s.signals["brake"]),
    "gear_ripple": lambda s, r: extra_power(s, column(s, 1, 4.0 * np.sin(17.3 * s.q[:, 1] + 0.4))),
    "thermostat": thermostat,
    "tool_actuation": lambda s, r: lagged_mean(4.0 * s.signals["tool"]),
    "line_voltage": lambda s, r: s.predicted * ((s.volts / 230.0) ** 2.5 - 1),
    "supply_efficiency": lambda s, r: 6.0 * (s.predicted / 100.0) ** 2,
    "contact_force": lambda s, r: pulses(s, r, 1.5, 4, 8) * lagged_mean(contact_power(s, 40.0)),
    "meter_gain": lambda s, r: 0.03 * s.predicted,
    "meter_saturation": lambda s, r: -0.9 * np.maximum(s.predicted - 1.45 * 124.0, 0),
    "process_load": lambda s, r: 7.0 * pulses(s, r, 2, 6, 9),
    "offset_shift": lambda s, r: np.full(s.rows, 4.0),
}  # fmt: skip


def gravity_torque_of_link(q, link, kg):
    robot = load_description("ur10e")
    joints = list(robot.joint)
    heavier = joints[link].link.model_copy(update={"mass": joints[link].link.mass + kg})
    joints[link] = joints[link].model_copy(update={"link": heavier})
    return gravity_torque(Arm(robot.model_copy(update={"joint": joints})), q) - gravity_torque(Arm(robot), q)


def contact_power(scene, newton):
    arm = load_description("ur10e")
    weight = gravity_torque(Arm(arm, Payload(1.0)), scene.q) - gravity_torque(Arm(arm), scene.q)
    return -(scene.power_per_torque * weight / 9.81 * newton).sum(axis=1)


COMMON = {"payload", "coulomb_friction", "offset_shift", "copper_loss", "clock_offset", "brake_holding"}


QUICK = {"payload", "coulomb_friction", "copper_loss", "brake_release", "thermostat", "line_voltage", "gear_ripple"}
slow = pytest.mark.skipif("ACQD_SLOW" not in os.environ, reason="takes minutes: ACQD_SLOW=1 make test")


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=slow) for n in sorted(INDEPENDENT)])
def test_an_effect_that_was_made_otherwise_is_named_first(name, model, robot):
    count = 14 if name in ("thermostat", "process_load", "mechanical_power") else 7
    only = COMMON | {name, *library()[name].neighbours}
    _, tracing = traced(model, robot, INDEPENDENT[name], count=count, only=only)
    assert [named.id for named in tracing.found][:1] == [name], (tracing.verdict, tracing.looked_at[:3])


@slow
def test_parameters_come_back(model, robot):
    _, tracing = traced(model, robot, INDEPENDENT["coulomb_friction"], only=COMMON)
    assert tracing.found[0].finding.candidate.label == "joint 2"
    assert tracing.found[0].finding.coefficients[0] == pytest.approx(4.0, rel=0.1)
    _, tracing = traced(model, robot, added_payload, only=COMMON)
    assert tracing.found[0].finding.coefficients[0] == pytest.approx(2.0, rel=0.1)
    _, tracing = traced(model, robot, INDEPENDENT["gear_ripple"], only=COMMON | {"gear_ripple"})
    assert tracing.found[0].shape["periods_per_turn"] == pytest.approx(17.3, abs=0.1)
    _, tracing = traced(model, robot, thermostat, count=14, only=COMMON | {"thermostat", "process_load"})
    assert tracing.found[0].shape["period_s"] == pytest.approx(47, rel=0.1)


def test_nothing_is_found_where_nothing_is(model, robot):
    _, tracing = traced(model, robot, None)
    assert tracing.verdict == "nothing_left", [named.id for named in tracing.found]


def test_what_the_library_does_not_know_is_called_unknown(model, robot):
    def band(scene, random):
        return lagged_mean(6.0 * np.exp(-(((np.abs(scene.qd[:, 1]) - 0.3) / 0.06) ** 2)))

    _, tracing = traced(model, robot, band, count=12)
    assert tracing.verdict == "unknown_structure", [(n.id, n.finding.candidate.label) for n in tracing.found]
    assert tracing.unknown.candidate.label == "the speed of joint 2"


def test_two_effects_are_both_named(model, robot):
    def both(scene, random):
        return added_payload(scene, random) + INDEPENDENT["thermostat"](scene, random)

    _, tracing = traced(model, robot, both)
    assert {named.id for named in tracing.found} == {"payload", "thermostat"}


def surge(scene, random):
    """A peak of hundreds of watts, of another height each time."""
    return random.uniform(0.97, 1.03) * lagged_mean(
        500.0 * (since_release(scene) >= 0) * np.exp(-since_release(scene) / 0.13)
    )


@pytest.mark.parametrize("beside", [None, "payload"])
def test_what_a_peak_leaves_over_hides_nothing_and_names_nothing(beside, model, robot):
    def both(scene, random):
        return surge(scene, random) + (0 if beside is None else 0.05 * added_payload(scene, random))

    _, tracing = traced(model, robot, both, only=COMMON | {"brake_release", "gravity_bias"})
    assert [named.id for named in tracing.found] == ["brake_release", *([beside] if beside else [])]


def test_an_onset_within_the_dataset_is_found(model, robot):
    in_question = [recording(model, k, added_payload if k >= 7 else None, seed=2) for k in range(14)]
    design, competing, gates = prepare(model, robot, in_question, [], COMMON, set(), lambda _: None)
    tracing = trace(design, competing, gates, Limits(), lambda _: None)
    assert tracing.found[0].id == "payload"
    assert tracing.found[0].gate.begin == "r_2_07"


def test_a_delay_is_seen_before_anything_else(model):
    segments = [recording(model, k, seed=3) for k in range(6)]
    late = [replace(s, P=np.interp(np.arange(len(s.P)) - 2.5, np.arange(len(s.P)), s.P)) for s in segments]
    scenes = [scene_of(model, s.q, s.signals, s.start_s, s.channels) for s in segments]
    assert find_delay(scenes, segments) is None
    delay = find_delay(scenes, late)
    assert delay is not None and not delay.drifts
    assert delay.offset_s == pytest.approx(0.1, abs=0.01)
    back = corrected(late[0], delay, STEP).P
    assert np.abs(back - segments[0].P)[20:-20].mean() < 0.5 * np.abs(late[0].P - segments[0].P)[20:-20].mean()


@settings(max_examples=15, deadline=None)
@given(st.floats(0.0, 0.95), st.integers(0, 1000))
def test_whitened_noise_is_white(memory, seed):
    random = np.random.default_rng(seed)
    noise = [lfilter([1], [1, -memory], random.normal(0, 2, 3000)) for _ in range(4)]
    white = [Whitener.of(noise).apply(each).astype(float) for each in noise]
    assert np.abs(autocorrelation(white, 10)).max() < 0.06
    assert np.concatenate(white).std() == pytest.approx(1.0, abs=0.06)


def test_on_and_off_are_found_in_coloured_noise():
    random = np.random.default_rng(4)
    noise = [lfilter([0.3], [1, -0.8], random.normal(0, 1, 1500)) for _ in range(6)]
    true = [((np.arange(1500) + 170 * k) % 400) < 150 for k in range(6)]
    states = search([n + 3.0 * on for n, on in zip(noise, true, strict=True)], Whitener.of(noise))
    assert states is not None and states.size == pytest.approx(3.0, rel=0.1)
    assert np.mean([(a == b).mean() for a, b in zip(states.on, true, strict=True)]) > 0.98
    none = search(noise, Whitener.of(noise))
    assert none is None or none.gain < 0.1 * states.gain


def test_a_rhythm_is_told_from_bursts():
    t = [100.0 * k + STEP * np.arange(1500) for k in range(20)]
    steady = [((each + 3) % 37) < 15 for each in t]
    random = np.random.default_rng(7)
    bursts = [np.repeat(random.random(30) < 0.3, 50) for _ in t]
    period, regular = rhythm(steady, t)
    assert period == pytest.approx(37, rel=0.05) and regular > 0.8
    assert rhythm(bursts, t)[1] < 0.3


def test_the_noise_floor_is_that_of_a_resting_arm(model):
    resting = [recording(model, k, seed=4, rows=2000) for k in range(4)]
    floor, where = noise_floor(resting, STEP)
    assert where.startswith("at rest")
    assert floor == pytest.approx(0.25 / np.sqrt(1 - 0.49), rel=0.3)


def test_quality_of_white_and_of_foreseeable_residuals():
    random = np.random.default_rng(1)
    white = quality([random.normal(1.0, 2.0, 5000)])
    assert white.rmse == pytest.approx(np.sqrt(5), rel=0.05) and white.bias == pytest.approx(-1, abs=0.1)
    assert white.whiteness < 0.03
    assert quality([np.cumsum(random.normal(0, 1, 5000))]).whiteness > 0.8


@slow
def test_derived_candidates_leave_the_residual_of_known_levels(model, robot):
    design, tracing = traced(model, robot, thermostat, count=14, only={"thermostat", "process_load"})
    left = np.concatenate([each for k, each in enumerate(residuals_of(design, tracing.model)) if k >= 14])
    assert left.std() < 1.2
    assert detect(design, tracing.model, design.in_question, set(DESIGN_IDS)) == []


def term(name, shape=None, coefficient=2.0):
    return Term(name, "somewhere", dict(shape or {}), (0,), np.array([coefficient]), {})


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
    assert load_reference(tmp_path) == []


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


# ---------------------------------------------------------------- as a user


def acqd(*arguments):
    done = subprocess.run(
        [sys.executable, "-m", "acqd", *map(str, arguments)],
        capture_output=True,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1", "COLUMNS": "160"},
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done


def write_dataset(folder, segments):
    """Power rows and logs as anybody could have them, and acqd's own merge."""
    logs = folder / "logs"
    logs.mkdir(parents=True)
    rows = ["time,P,Vrms,flags"]
    for segment in segments:
        t = segment.start_s + STEP * np.arange(len(segment.P))
        volts = segment.channels["Vrms"]
        rows += [f"{a - STEP / 2:.6f},{b:.6f},{c:.4f},simulated" for a, b, c in zip(t, segment.P, volts, strict=True)]
        header = ",".join(["time", *(f"q{k + 1}" for k in range(segment.q.shape[1])), "brake"])
        lines = [
            f"{when:.6f}," + ",".join(f"{x:.8f}" for x in q) + f",{int(b)}"
            for when, q, b in zip(t, segment.q, segment.signals["brake"], strict=True)
        ]
        (logs / f"{segment.recording}.csv").write_text("\n".join([header, *lines, ""]))
    (folder / "power.csv").write_text("\n".join([*rows, ""]))
    merge = ("dataset", "build", "--power", folder / "power.csv", "--logs", logs, "--robot", "ur10e", "--lag", 0)
    done = acqd(*merge, "--out", folder / "ds")
    assert done.returncode == 0, done.stderr
    return folder / "ds"


@pytest.fixture(scope="module")
def closed(model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("loop")
    reference = write_dataset(folder / "before", [recording(model, k, seed=1, rows=900) for k in range(9)])
    in_question = [recording(model, k, added_payload, seed=2, rows=900, start_s=1e9 + 9000) for k in range(12)]
    now = write_dataset(folder / "now", in_question)
    done = acqd("train", reference, "--network", "grey-box", "--out", folder / "model")
    assert done.returncode == 0, done.stderr
    done = acqd("close-loop", now, "--model", folder / "model", "--json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


def test_close_loop_names_the_payload_and_writes_what_the_design_says(closed):
    folder, report = closed
    fixed = {"target", "unit", "measured", "recordings", "noise_floor", "before", "after", "verdict", "effects"}
    assert fixed | {"unexplained"} <= set(report)
    assert (report["target"], report["unit"], report["measured"]) == ("P", "W", "simulated")
    assert set(report["before"]) == set(report["after"]) == {"mae", "rmse", "bias", "whiteness"}
    assert report["verdict"] == "effects_found"
    effect = report["effects"][0]
    keys = {"id", "where", "parameters", "delta_rmse", "share_of_explainable", "confidence", "rivals", "evidence"}
    assert effect["id"] == "payload" and keys <= set(effect)
    mass = effect["parameters"]["mass"]
    assert mass["unit"] == "kg" and mass["ci95"][0] < mass["value"] < mass["ci95"][1]
    assert mass["value"] == pytest.approx(2.0, rel=0.15)
    assert report["after"]["rmse"] < 0.6 * report["before"]["rmse"]
    assert report["reference_rmse"] < report["after"]["rmse"]
    written = json.loads((folder / "now" / "ds.loop" / "report.json").read_text())
    assert written["effects"] == report["effects"]
    page = (folder / "now" / "ds.loop" / "report.html").read_text()
    assert "simulated data" in page and "payload" in page and page.count("data:image/png") >= 6


def test_the_augmented_bundle_predicts_and_can_be_closed_on_again(closed):
    folder, report = closed
    augmented = folder / "now" / "ds.loop" / "model"
    assert [each["id"] for each in load_bundle(augmented).metadata["effects"]] == [e["id"] for e in report["effects"]]
    log = next((folder / "now" / "logs").iterdir())
    before, after = (json.loads(acqd("predict", b, log, "--json").stdout) for b in (folder / "model", augmented))
    assert after["mean_W"] != pytest.approx(before["mean_W"], abs=0.05)
    again = acqd("close-loop", folder / "before" / "ds", "--model", augmented, "--out", folder / "again", "--json")
    assert again.returncode == 0, again.stderr
    found = json.loads(again.stdout)
    assert [e["id"] for e in found["effects"]][:1] == ["payload"]  # it has gone again: a mass of minus two kg
    assert found["effects"][0]["parameters"]["mass"]["value"] == pytest.approx(-2.0, rel=0.2)


@slow
def test_the_same_seed_gives_the_same_report(closed):
    folder, report = closed
    again = acqd("close-loop", folder / "now" / "ds", "--model", folder / "model", "--out", folder / "twin", "--json")
    second = json.loads(again.stdout)
    assert {k: v for k, v in second.items() if k != "out"} == {k: v for k, v in report.items() if k != "out"}


@slow
def test_only_and_exclude(closed):
    folder, _ = closed
    common = ("close-loop", folder / "now" / "ds", "--model", folder / "model", "--json", "--out")
    without = json.loads(acqd(*common, folder / "w", "--exclude", "payload", "--max-effects", 1).stdout)
    assert "payload" not in [each["id"] for each in without["effects"]]
    assert without["after"]["rmse"] <= without["before"]["rmse"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nowhere", "--model", "{model}"), "nowhere"),
        (("{ds}", "--model", "{ds}"), "no bundle"),
        (("{ds}", "--model", "{model}", "--only", "paylod"), "paylod"),
        (("{ds}", "--model", "{model}", "--reference", "{model}"), "model"),
        (("{ds}", "--model", "{model}", "--out", "{ds}"), "choose another --out"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(closed, arguments, said):
    folder, _ = closed
    places = {"model": folder / "model", "ds": folder / "now" / "ds"}
    done = acqd("close-loop", *(each.format(**places) for each in arguments))
    assert done.returncode == 2
    assert said in done.stderr and len(done.stderr.strip().splitlines()) == 1


def test_too_few_recordings_are_refused(model, closed, tmp_path):
    folder, _ = closed
    few = write_dataset(tmp_path, [recording(model, k, seed=6) for k in range(3)])
    done = acqd("close-loop", few, "--model", folder / "model")
    assert done.returncode == 2 and "too few" in done.stderr


def test_many_pieces_that_are_too_short_are_refused(model, closed, tmp_path):
    folder, _ = closed
    short = write_dataset(tmp_path, [recording(model, k, seed=6, rows=60) for k in range(14)])
    done = acqd("close-loop", short, "--model", folder / "model")
    assert done.returncode == 2 and "0 recordings of at least 4.8 s" in done.stderr


@pytest.mark.parametrize("words", [("--watch", "--since", "2026-01-01"), ("--every", "2")])
def test_options_that_would_do_nothing_are_refused(closed, words):
    folder, _ = closed
    done = acqd("close-loop", folder / "now" / "ds", "--model", folder / "model", *words)
    assert done.returncode == 2 and "--watch" in done.stderr and len(done.stderr.strip().splitlines()) == 1


@pytest.mark.timeout(300)
def test_a_watch_raises_the_alarm_proposes_and_goes_on_after_a_restart(closed, tmp_path):
    folder, _ = closed
    order = CloseConfig(folder / "now" / "ds", folder / "model", tmp_path / "watch", only=("payload", "offset_shift"))
    events = list(Watch(order, 200 * 3600.0).look(lambda *_: None))
    kinds = [event.kind for event in events]
    assert kinds.count("recording") == 12 and kinds.count("alarm") == 1
    proposal = events[-1].details
    assert [effect["id"] for effect in proposal["effects"]] == ["payload"]
    assert load_bundle(Path(proposal["out"]) / "model").metadata["effects"]
    again = Watch(order, 200 * 3600.0)
    assert again.resumed.details["proposed"] and again.resumed.details["alarm"]["onset_s"] < 1e9 + 9000 + 180
    assert list(again.look(lambda *_: None)) == []  # nothing twice
    (order.out / "watch.json").write_text("{")
    with pytest.raises(InputError, match="delete it to begin anew"):
        Watch(order, 200 * 3600.0)


def test_a_watch_by_command_tells_line_by_line_until_it_is_asked_to_stop(closed, tmp_path):
    folder, _ = closed
    command = [
        *(sys.executable, "-m", "acqd", "close-loop", folder / "before" / "ds", "--model", folder / "model"),
        *("--out", tmp_path / "watch", "--watch", "--json", "--every", "0.5"),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        first = json.loads(process.stdout.readline())
        assert first["event"] == "recording"
        process.terminate()
        rest, errors = process.communicate(timeout=60)
    assert process.returncode == 0 and not errors
    assert not [line for line in rest.splitlines() if json.loads(line)["event"] == "alarm"]


def test_a_withheld_term_is_named_and_comes_back(closed):
    folder, _ = closed
    ds = folder / "before" / "ds"
    poor = folder / "poor"
    done = acqd("train", ds, "--network", "grey-box", "--without", "coulomb_friction", "--out", poor)
    assert done.returncode == 0, done.stderr
    report = json.loads(acqd("close-loop", ds, "--model", poor, "--out", folder / "poor.loop", "--json").stdout)
    assert [each["id"] for each in report["effects"]][:1] == ["coulomb_friction"]
    assert report["after"]["rmse"] < 0.9 * report["before"]["rmse"]
    assert load_bundle(folder / "poor.loop" / "model").metadata["withheld"] == []


def test_effects_without_their_carrier_are_refused(tmp_path, model):
    with pytest.raises(ValueError, match="unknown to this version"):
        Term.from_json(term("payload").as_json() | {"id": "magic"})
    assert padded(np.zeros((3, 2)), 2).shape == (7, 2)
    with pytest.raises(UserError):
        Path(tmp_path, "x").write_text("")
        save_bundle(tmp_path / "x", Bundle({}, {}))


def test_a_heavy_payload_takes_what_a_model_with_that_body_takes(model):
    """Copper loss goes with the square of torque: exact, not to first order, and against the rigid body itself."""
    kg, reach = 6.0, 0.07
    x, y, z = model.chain.beyond_flange(reach)
    body = kg * np.array([1, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])
    values = model.values.copy()
    inertial = model.layout.place("inertial")
    values[inertial.stop - 10 : inertial.stop] += body
    loaded = GreyBox(model.chain, model.layout, values, STEP, np.ones(1))
    segment = recording(model, 2, seed=9)
    scene = scene_of(model, segment.q, segment.signals, segment.start_s, segment.channels)
    with_body = scene_of(loaded, segment.q, segment.signals, segment.start_s, segment.channels)
    payload = term("payload", {"centre_of_mass_m": reach}, kg)
    np.testing.assert_allclose(payload.rows(scene), with_body.predicted - scene.predicted, atol=1e-6)
