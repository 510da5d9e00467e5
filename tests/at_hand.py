"""A small grey box of a UR10e as a bundle, without training."""

import numpy as np

from acqd.models.bundle.bundle import Bundle
from acqd.models.greybox.bundle_io import arrays_of
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import Layout, prior
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.dynamics import inertial_parameters
from acqd.robot.newton_euler import Chain

STEP = 0.04
ROBOT = load_description("ur10e")
AXES = ROBOT.axes


def about(kind, **more):
    """What bundle.json needs."""
    return {
        "kind": kind, "name": "trial", "robot": ROBOT.name, "description": "ur10e", "axes": AXES, "step_s": STEP,
        "inputs": [], "provenance": {"fit_recordings": [], "validation_recordings": [], "manifest_sha256": ""},
    } | more  # fmt: skip


def grey():
    """A grey box with drives as a small robot has them."""
    layout = Layout(AXES, ("brake",))
    values = prior(layout, ROBOT, inertial_parameters(Arm(ROBOT)), 120.0, STEP).mean.copy()
    values[layout.place("coulomb")], values[layout.place("viscous")] = 5.0, 6.0
    values[layout.place("signals")], values[layout.place("lag")] = 4.0, 0.012
    return GreyBox(Chain.of(ROBOT), layout, values, STEP, np.ones(1))


def grey_bundle(reference=None, **more):
    """The same as a bundle."""
    return Bundle(about("grey_box", signals=["brake"], **more), arrays_of(grey()), reference)
