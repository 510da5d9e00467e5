"""Logged torques as a witness: what they see, how large, and that unchanged sessions show nothing."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.discrepancy.joints.observations import runs_of_motion, session_key
from acqd.discrepancy.joints.summary import joint_level
from acqd.discrepancy.joints.witness import Witness
from acqd.models.effects import library
from acqd.models.effects.scene import segment_scene
from acqd.models.effects.substeps import averaged
from acqd.robot.arm import Arm, Payload
from acqd.robot.dynamics import inverse_dynamics
from tests.builders import ROBOT, grey, recording
from tests.discrepancy.independent import extra_power, selected

ALL = frozenset(library())
CONSTANT = np.array([joint.drive.effort_per_ampere for joint in ROBOT.joint])


def logged(model, number, seed, payload=None, friction=0.0, sensor=False, add=None):
    """A recording with motor currents (or link torques) as the motion has them, and noise; `add` changes the power."""
    segment = recording(model, number, add, rows=450, seed=seed, start_s=1e9 + 5000 * seed)
    scene = segment_scene(model, segment)
    torque = scene.tau_rigid if sensor else scene.tau
    if payload is not None:
        arms = Arm(ROBOT, payload), Arm(ROBOT)
        loaded, bare = (inverse_dynamics(arm, scene.q, scene.qd, scene.qdd) for arm in arms)
        torque = torque + loaded - bare
    torque = averaged(torque + friction * np.tanh(scene.qd[:, [1]] / 0.02) * np.eye(6)[1])
    random = np.random.default_rng([seed, number, 7])
    torque = torque + random.normal(0, 0.3, torque.shape) + random.normal(0, 0.1, 6)
    if sensor:
        return replace(segment, tau=torque)
    return replace(segment, channels=segment.channels | {"current": torque / CONSTANT})


def witness_of(model, **change):
    segments = [(logged(model, k, 1, sensor=change.get("sensor", False)), False) for k in range(4)]
    segments += [(logged(model, k, 2, **change), True) for k in range(2)]
    scenes = [segment_scene(model, segment) for segment, _ in segments]
    return Witness.of(model, ROBOT, segments, scenes)


def best_of(witness, effect_id, where):
    scene = next(iter(witness.observed.scenes.values()))
    weights = {session.name: 1.0 for session in witness.sessions if session.in_question}
    variants = [v for v in library()[effect_id].variants(scene) if v.place.where == where]
    found = [witness.information(effect_id, variant, weights, scanned=True) for variant in variants]
    best = max(found, key=lambda information: information.evidence)
    return best.evidence, np.linalg.solve(best.precision, best.product)


@pytest.fixture(scope="module")
def model():
    return grey()


def test_a_payload_beside_the_axis_is_seen_with_its_size(model):
    witness = witness_of(model, payload=Payload(1.2, (0.0, 0.1, 0.05)))
    evidence, (mass, first, second) = best_of(witness, "payload", "flange, beside its axis")
    alone, _ = best_of(witness, "payload", "flange")
    assert evidence > alone + 50
    assert mass == pytest.approx(1.2, rel=0.12)
    assert np.hypot(first, second) == pytest.approx(0.12, rel=0.15)
    level = joint_level(witness, ALL)
    assert level.explains == "payload" and 2 in level.changed
    assert "mechanical change" in level.as_text() and len(level.as_json()) == 6
    scene = next(iter(witness.observed.scenes.values()))
    place = next(v for v in library()["payload"].variants(scene) if v.place.where == "flange, beside its axis")
    after = joint_level(witness.given("payload", place), ALL)
    assert after.evidence < 0.1 * level.evidence


def test_unchanged_sessions_show_nothing(model):
    level = joint_level(witness_of(model), ALL)
    assert level.explains == "" and level.changed == []
    assert "no mechanical change" in level.as_text()


def test_friction_shows_in_currents_and_not_behind_the_gear(model):
    currents = witness_of(model, friction=6.0)
    evidence, (torque,) = best_of(currents, "coulomb_friction", "joint 2")
    assert evidence > 12 and torque == pytest.approx(6.0, rel=0.15)
    assert 0 < currents.learning_rate <= 1
    sensors = witness_of(model, sensor=True)
    assert not sensors.sees("coulomb_friction") and sensors.sees("payload")
    assert not sensors.sees("copper_loss")


def test_what_unchanged_sessions_differ_by_shows_in_torques(model):
    """Four sessions that carry other bodies differ by more than the same body four times."""
    weights = {"new r_2_00": 1.0, "new r_2_01": 1.0}
    spreads = []
    for kg in (0.0, 2.0):
        bodies = [Payload(kg * (k % 2), (0.0, 0.0, 0.05)) for k in range(4)]
        segments = [(logged(model, k, 1, payload=body), False) for k, body in enumerate(bodies)]
        segments += [(logged(model, k, 2), True) for k in range(2)]
        witness = Witness.of(model, ROBOT, segments, [segment_scene(model, segment) for segment, _ in segments])
        place = next(v for v in library()["payload"].variants(witness.observed.scenes[0]) if v.place.where == "flange")
        seen = witness.differences("payload", place, weights, np.ones(1), scanned=True)
        assert len(seen.sizes) == len(seen.information) == 4 and seen.usual > 0
        spreads.append(float(np.std(seen.sizes)))
    assert spreads[1] > 0.8 > 4 * spreads[0]


def test_without_torques_on_both_sides_there_is_no_witness(model):
    bare = recording(model, 0, rows=300)
    both = [(logged(model, 1, 1), False), (bare, True)]
    assert Witness.of(model, ROBOT, both, [segment_scene(model, s) for s, _ in both]) is None
    assert joint_level(None, ALL) is None


def test_rows_at_which_a_joint_may_stick_say_nothing():
    speed = np.concatenate([np.zeros(20), np.full(30, 0.2), np.zeros(5), np.full(6, 0.2), np.full(30, -0.2)])
    assert runs_of_motion(speed, slice(0, len(speed)), all_rows=False) == [(20, 50), (55, 91)]
    assert runs_of_motion(speed, slice(3, 89), all_rows=True) == [(3, 89)]
    assert session_key("log_p003", in_question=True) == session_key("log_p017", in_question=True)
    assert session_key("log_p003", in_question=True) != session_key("log_p003", in_question=False)


def test_equal_names_on_both_sides_are_two_sessions(model):
    before = [replace(logged(model, k, 1), recording=f"r{k}") for k in range(3)]
    after = [replace(logged(model, k, 2, payload=Payload(1.2, (0.0, 0.1, 0.05))), recording=f"r{k}") for k in range(2)]
    segments = [(segment, False) for segment in before] + [(segment, True) for segment in after]
    witness = Witness.of(model, ROBOT, segments, [segment_scene(model, segment) for segment, _ in segments])
    assert sum(session.in_question for session in witness.sessions) == 2 and len(witness.sessions) == 5
    assert joint_level(witness, ALL).explains == "payload"


@pytest.mark.slow
def test_the_loop_asks_power_and_torques(model):
    body = Payload(1.2, (0.0, 0.1, 0.05))

    def carried(scene, random):
        loaded, bare = (inverse_dynamics(arm, scene.q, scene.qd, scene.qdd) for arm in (Arm(ROBOT, body), Arm(ROBOT)))
        return extra_power(scene, loaded - bare)

    before = [logged(model, k, 1) for k in range(4)]
    only = {"payload", "gravity_bias", "coulomb_friction", "offset_shift", "copper_loss"}
    after = [logged(model, k, 2, payload=body, add=carried) for k in range(4)]
    _, selection = selected(model, ROBOT, after, before, only)
    named = selection.effects[0]
    assert (named.id, named.place.where) == ("payload", "flange, beside its axis")
    assert named.finding.at_joints > 50 and selection.witness is not None
    # torques without power, or power without torques, are a contradiction and no payload
    contradicted = [logged(model, k, 2, payload=body) for k in range(4)]
    _, selection = selected(model, ROBOT, contradicted, before, only)
    assert "payload" not in [effect.id for effect in selection.effects]
