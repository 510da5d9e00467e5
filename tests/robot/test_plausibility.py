"""What no real arm can have is found; what real arms have is not."""

import pytest

from acqd.robot import load_description
from acqd.robot.plausibility import implausible
from tests.robot.sliding import DRIVE, link, robot, scara, slide, turn
from tests.robot.states import ROBOTS


def states(*changes, **keys):
    """Findings on an arm of two links, its second link or joint changed: state by place."""
    body = link(4, (0.2, 0, 0), (0.004, 0.06, 0.06, 0, 0, 0))
    for change in changes:
        body = body | change
    made = robot(
        turn("shoulder", [0, 1, 0], link(6, (0.2, 0, 0), (0.006, 0.08, 0.08, 0, 0, 0)), torque_Nm=120),
        turn("elbow", [0, 1, 0], body, xyz=[0.4, 0, 0], **keys),
    )
    return {finding.where: finding.state for finding in implausible(made)}


@pytest.mark.parametrize("name", ROBOTS)
def test_nothing_is_wrong_with_a_shipped_robot(name):
    assert implausible(load_description(name)) == []


def test_nothing_is_wrong_with_sensible_links():
    assert states() == {}
    assert all(finding.state != "wrong" for finding in implausible(scara()))


@pytest.mark.parametrize(
    ("link_change", "joint_change", "where", "state"),
    [
        ({"inertia": (0.01, 0.01, 0.05, 0, 0, 0)}, {}, "elbow.link.inertia", "wrong"),
        ({"inertia": (9, 9, 9, 0, 0, 0)}, {}, "elbow.link.inertia", "doubtful"),
        ({"com": (0, 0, 3)}, {"torque_Nm": 500}, "elbow.link.com", "doubtful"),
        ({}, {"torque_Nm": 5}, "elbow.torque_Nm", "wrong"),
        ({}, {"speed_deg_s": 6000}, "elbow.speed_deg_s", "doubtful"),
        ({}, {"drive": DRIVE | {"rotor_inertia_kgm2": 50}}, "elbow.drive", "doubtful"),
        ({}, {"drive": DRIVE | {"gear_ratio": 1}}, "elbow.drive", "doubtful"),
        ({"mass": 90000}, {"torque_Nm": 1e9}, "link.mass", "doubtful"),
    ],
)
def test_what_cannot_be_is_found_by_joint_and_key(link_change, joint_change, where, state):
    assert states(link_change, **joint_change)[where] == state


def test_placeholders_for_all_joints_are_doubted():
    made = robot(*(turn(f"j{k}", [0, 1, 0], link(1), torque_Nm=1e5, xyz=[0.3, 0, 0]) for k in range(3)))
    assert {finding.where for finding in implausible(made)} >= {"link.mass", "torque_Nm"}


@pytest.mark.parametrize("inertia", [(0.01, 0.02, -0.01, 0, 0, 0), (0.01, 0.01, 0.01, 0.05, 0, 0)])
def test_a_tensor_with_a_negative_moment_is_no_description(inertia):
    with pytest.raises(ValueError, match="negative principal moment"):
        states({"inertia": inertia})


def test_level_slides_hold_nothing_and_are_as_long_as_their_travel():
    body = link(40.0, (0, 0, 0), (1, 1, 1, 0, 0, 0))
    table = robot(slide("y", [0, 1, 0], body, limits_m=[0, 0.3]), slide("x", [1, 0, 0], body, limits_m=[0, 0.4]))
    assert [each.where for each in implausible(table)] == []
