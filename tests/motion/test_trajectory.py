"""Trajectories in files."""

import numpy as np
import pytest

from acqd.errors import InputError
from acqd.motion.trajectory import read_trajectory, write_trajectory
from tests.lab.moved import IIWA


def test_trajectories_survive_their_file(tmp_path, drawn):
    path = tmp_path / "t.csv"
    write_trajectory(path, drawn[0][0], IIWA)
    again = read_trajectory(path, IIWA)
    np.testing.assert_allclose(again.waypoints, drawn[0][0].waypoints, atol=1e-7)


def test_a_last_position_with_fewer_digits_is_a_position(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("\n".join([*(f"0,0,0,0,0,0,{k / 10:.3f}" for k in range(20)), "0,0,0,0,0,0,0.5"]))
    assert len(read_trajectory(path, IIWA).waypoints) == 21


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("A1_deg,A2_deg\n1,2\n", "header A1_deg,A2_deg; expected A1_deg,A2_deg,A3_deg"),
        ("1,2,3,4,5,6\n", "has 6 columns, but iiwa7_r800 has 7 axes"),
        ("0,0,0,0,0,0,0\n0,130,0,0,0,0,0\n", "row 2: A2 = 130 deg is outside -120 .. 120 deg"),
        ("0,0,0,0,0,0,0\n0,,0,0,0,0,0\n", "row 2: column 2 is not a number"),
    ],
)
def test_a_broken_trajectory_is_named_where_it_is_broken(tmp_path, text, complaint):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=complaint):
        read_trajectory(path, IIWA)
