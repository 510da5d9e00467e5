"""Descriptions from URDF files: against Pinocchio's own reader; what is missing is guessed and marked."""

import re

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import InputError
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.dynamics import inverse_dynamics
from acqd.robot.kinematics import forward_kinematics
from acqd.robot.toml_text import description_text
from acqd.robot.urdf.describe import describe_urdf
from tests.robot.urdf.files import CYLINDER, GRIPPER, arm, joint, link

XACRO = "<robot xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:macro/></robot>"


def described(tmp_path, text, **options):
    path = tmp_path / "little.urdf"
    path.write_text(text)
    return describe_urdf(path, **options)


def pinocchios(text, moving):
    """Pinocchio's model of the same text; joints outside `moving` are held at zero."""
    model = pin.buildModelFromXML(text)
    held = [k for k in range(1, model.njoints) if model.names[k] not in moving]
    return pin.buildReducedModel(model, held, pin.neutral(model))


LIMITED = joint("elbow", "revolute", "upper", "lower", "0 0 0.4", axis="0 1 1")
UNLIMITED = joint("elbow", "continuous", "upper", "lower", "0 0 0.4", axis="0 1 1")


@pytest.mark.parametrize(("more", "tip"), [((), None), (GRIPPER, "tool0")])
def test_bodies_and_places_are_those_of_pinocchios_reader(tmp_path, more, tip):
    text = arm(*more, swap=[(UNLIMITED, LIMITED)])
    robot = described(tmp_path, text, tip=tip).robot
    model = pinocchios(text, [each.name for each in robot.joint])
    motion = np.random.default_rng(2).normal(size=(3, 20, 3))
    data = model.createData()
    theirs = [pin.rnea(model, data, *(part[k] for part in motion)) for k in range(20)]
    np.testing.assert_allclose(inverse_dynamics(Arm(robot), *motion), theirs, atol=1e-6)
    places, _ = forward_kinematics(Arm(robot), motion[0])
    tool = model.getFrameId("tool0")
    for q, place in zip(motion[0], places, strict=True):
        pin.framesForwardKinematics(model, data, q)
        np.testing.assert_allclose(data.oMf[tool].translation, place, atol=1e-8)


def test_a_description_survives_its_file(tmp_path):
    converted = described(tmp_path, arm())
    path = tmp_path / "little.toml"
    path.write_text(description_text(converted.table, ["a comment"]))
    assert load_description(str(path)) == converted.robot


def test_units_limits_and_capsules_are_converted(tmp_path):
    rail, shoulder, elbow = described(tmp_path, arm()).robot.joint
    assert rail.slides
    assert rail.limits == (-1.5, 2)
    np.testing.assert_allclose(shoulder.limits, np.degrees([-1.5, 2]))
    assert shoulder.speed == pytest.approx(np.degrees(2))
    assert elbow.limits == (-360, 360)
    (capsule,) = shoulder.capsules
    assert (capsule.radius, capsule.start, capsule.end) == (0.05, (0, 0, 0.05), (0, 0, 0.35))


def test_what_the_file_does_not_hold_is_guessed_and_marked(tmp_path):
    bare = joint("shoulder", "revolute", "cart", "upper", "0 0 0.3", "0.2 0 0.3", axis="0 1 0")
    without = joint("shoulder", "revolute", "cart", "upper", "0 0 0.3", "0.2 0 0.3", axis="0 1 0", limit="")
    converted = described(tmp_path, arm(swap=[(bare, without)]))
    rail, shoulder, elbow = converted.robot.joint
    assert rail.guessed == ["acceleration_m_s2", "drive", "friction"]
    assert {"limits_deg", "speed_deg_s", "torque_Nm"} <= set(shoulder.guessed)
    assert elbow.is_guessed("drive.resistance_Ohm")
    assert not elbow.is_guessed("link.mass")
    assert 20 < shoulder.effort < 200  # 8.7 kg at up to half a metre, times the margin
    assert any("continuous" in note and "elbow" in note for note in converted.notes)
    assert any("meshes of lower" in note for note in converted.notes)


def test_friction_in_the_file_is_kept_where_it_is_plausible(tmp_path):
    limit = 'lower="-1" upper="1" velocity="2" effort="40"'
    for dynamics, guessed in (('damping="1.5" friction="2"', False), ('damping="0.001"', True)):
        given = joint(
            "elbow", "revolute", "upper", "lower", "0 0 0.4", axis="0 1 1", limit=limit, more=f"<dynamics {dynamics}/>"
        )
        elbow = described(tmp_path, arm(swap=[(UNLIMITED, given)])).robot.joint[2]
        assert elbow.is_guessed("friction") == guessed
        assert (elbow.friction.coulomb == 2) != guessed


def test_the_base_may_lie_beyond_other_joints(tmp_path):
    from_root = described(tmp_path, arm()).robot
    from_cart = described(tmp_path, arm(), base="cart").robot
    assert [each.name for each in from_cart.joint] == ["shoulder", "elbow"]
    # gravity still acts along the root's z: the cart is tilted on its rail
    q = np.array([[0.4, -0.7]])
    still = np.zeros((1, 2))
    whole = inverse_dynamics(Arm(from_root), np.hstack([[[0.0]], q]), *np.zeros((2, 1, 3)))
    np.testing.assert_allclose(inverse_dynamics(Arm(from_cart), q, still, still), whole[:, 1:], atol=1e-7)


def test_a_tensor_that_no_body_has_does_not_matter_on_the_still_base(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(arm().replace('izz="0.01"', 'izz="-0.1"', 1))
    assert describe_urdf(path).robot.axes


@pytest.mark.parametrize(
    ("text", "options", "complaint"),
    [
        (arm(*GRIPPER), {}, r"branches after 'elbow' into joints finger, other; .* --tip: tool0, left, right"),
        (arm(*GRIPPER), {"tip": "right"}, r"joint 'other' mimics 'finger' .* --tip tool0"),
        (arm(), {"tip": "hand"}, r"has no link 'hand' for --tip; its links are base, cart, upper"),
        (arm(), {"base": "upper", "tip": "cart"}, r"link 'cart' \(--tip\) does not hang on 'upper' \(--base\)"),
        (arm(), {"base": "sensor"}, "has no moving joint between 'sensor'"),
        (
            arm(swap=[(link("base", 10), "<link name='base'/>")])
            .replace("<inertial>", "<x>")
            .replace("</inertial>", "</x>"),
            {},
            "has no masses",
        ),
        (arm(swap=[(link("cart", 8, "0 0.1 0.05"), link("cart"))]), {}, "link cart moves and has no mass"),
        (arm(joint("up", "floating", "tool0", "kite"), link("kite", 1)), {}, "joint 'up' is floating"),
        (
            "<robot xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:macro/></robot>",
            {},
            "is a xacro file; expand it first",
        ),
        ("<robot", {}, "is not valid XML"),
        ("<sdf/>", {}, "starts with <sdf>; expected the <robot>"),
        (arm().replace('child link="upper"', 'child link="uper"'), {}, "joint 'shoulder' names link 'uper'"),
        (arm().replace('mass value="5"', 'mass value="five"'), {}, "'upper': value='five' is no number"),
        (arm().replace('mass value="5"', 'mass value="-5"'), {}, "'upper': mass -5 kg is negative"),
        (arm().replace('izz="0.01"', 'izz="-0.1"', 2), {}, "'cart': <inertia> has a negative principal moment"),
        (arm().replace('"revolute"', '"hinge"'), {}, "joint 'shoulder' has type 'hinge'; expected one of"),
        (arm(link("alone", 1)), {}, "has 2 links without a parent"),
        (arm(joint("again", "fixed", "base", "tool0")), {}, "link 'tool0' hangs on two joints"),
    ],
)
def test_what_is_wrong_or_ambiguous_is_refused_by_name(tmp_path, text, options, complaint):
    with pytest.raises(InputError, match=complaint):
        described(tmp_path, text, **options)


def test_spheres_and_boxes_become_capsules(tmp_path):
    box = CYLINDER.replace('<cylinder radius="0.05" length="0.4"/>', '<box size="0.06 0.5 0.08"/>')
    sphere = CYLINDER.replace('<cylinder radius="0.05" length="0.4"/>', '<sphere radius="0.07"/>')
    upper = link("upper", 5, "0 0 0.2", "0.3 0.2 0.1", collision=CYLINDER)
    text = arm(swap=[(upper, link("upper", 5, collision=box + sphere))])
    first, second = described(tmp_path, text).robot.joint[1].capsules
    assert (first.radius, first.start, first.end) == (0.05, (0, -0.2, 0.2), (0, 0.2, 0.2))
    assert (second.radius, second.start, second.end) == (0.07, (0, 0, 0.2), (0, 0, 0.2))


TEXT = arm(*GRIPPER)
JUNK = st.sampled_from(
    ["", "0", "-1", "1e400", "nan", "0 0 0", "base", "lower", '"', "<", "joint", "prismatic", "planar"]
)


@settings(max_examples=150)
@given(st.integers(0, len(TEXT)), st.integers(0, 40), JUNK)
def test_a_damaged_file_is_read_or_refused_in_one_line(tmp_path_factory, start, length, junk):
    path = tmp_path_factory.getbasetemp() / "damaged.urdf"
    path.write_text(TEXT[:start] + junk + TEXT[start + length :])
    try:
        converted = describe_urdf(path, tip="tool0")
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite(inverse_dynamics(Arm(converted.robot), *np.zeros((3, 1, converted.robot.axes)))).all()


@settings(max_examples=150)
@given(st.data())
def test_a_damaged_value_is_read_or_refused_in_one_line(tmp_path_factory, data):
    values = [m.span(1) for m in re.finditer(r'="([^"]*)"', TEXT)]
    start, end = data.draw(st.sampled_from(values))
    path = tmp_path_factory.getbasetemp() / "damaged.urdf"
    path.write_text(TEXT[:start] + data.draw(JUNK.filter(lambda junk: junk not in '"<')) + TEXT[end:])
    try:
        converted = describe_urdf(path, tip="tool0")
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite(inverse_dynamics(Arm(converted.robot), *np.zeros((3, 1, converted.robot.axes)))).all()
