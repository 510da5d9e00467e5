"""The chain of a description as plain numbers, against the geometry of its posture."""

import numpy as np
import pytest

from acqd.models.effects.cause import Cause
from acqd.report.palette import CAUSES
from acqd.robot.description import load_description
from acqd.robot.frames import frames_of
from acqd.robot.posture import Posture
from tests.robot.sliding import scara

DESCRIPTIONS = [*map(load_description, ("iiwa7_r800", "ur10e", "kinova_gen3")), scara()]


@pytest.mark.parametrize("description", DESCRIPTIONS, ids=lambda each: each.name)
def test_placements_and_axes_give_the_places_of_the_joints(description):
    frames = frames_of(description)
    q = np.linspace(-1.0, 1.0, description.axes)
    at, points = np.eye(4), []
    for joint, angle in zip(frames["joints"], q, strict=True):
        x, y, z = joint["axis"]
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        moved = (np.eye(3), np.array([joint["axis"]]).T * angle) if joint["slides"] else (turn, np.zeros((3, 1)))
        at = at @ placement(joint["at"]) @ np.block([[*moved], [0, 0, 0, 1]])
        points.append(at[:3, 3])
    points.append((at @ placement(frames["flange"]))[:3, 3])
    assert np.allclose(points, Posture.of(description, q).points[1:], atol=2e-5)


def placement(rows):
    """[4, 4] of twelve numbers."""
    return np.vstack([np.reshape(rows, (3, 4)), [0, 0, 0, 1]])


def test_a_sliding_joint_has_a_travel():
    assert [joint["travel"] for joint in frames_of(scara())["joints"]] == [0, 0, 1, 0]


def test_every_cause_has_a_colour():
    assert set(CAUSES) == {cause.value for cause in Cause} and len(set(CAUSES.values())) == len(CAUSES)
