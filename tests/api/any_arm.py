"""A regressor for the checks of scikit-learn, which come with any number of columns."""

import tempfile
from functools import cache
from pathlib import Path

from acqd.api.estimator import PowerRegressor
from acqd.robot.toml_text import description_text
from tests.robot.sliding import link, turn

TOY = {"speed_deg_s": 1e6, "acceleration_deg_s2": 1e9, "limits_deg": [-360, 360]}
"""The rows of the checks are drawn at random, which no robot could follow."""


@cache
def arm(axes):
    """The description of a robot with so many joints."""
    joints = [
        turn(f"j{k}", [0, k % 2, 1 - k % 2], link(2.0, (0, 0.1, 0.1)), xyz=[0, 0, 0.2]) | TOY for k in range(axes)
    ]
    table = {"name": f"arm{axes}", "title": "arm", "sources": ["made"], "base": {"mass": 1}, "joint": joints}
    path = Path(tempfile.mkdtemp(prefix="acqd-test-")) / f"arm{axes}.toml"
    path.write_text(description_text(table | {"flange": {"xyz": [0, 0, 0.1]}}))
    return str(path)


class AnyArm(PowerRegressor):
    """A grey box of a robot with as many joints as X has columns: the checks come with 1 to 10 columns."""

    def __init__(self, network="grey-box"):
        super().__init__(network)

    def _robot_of(self, axes):
        return arm(axes)
