"""A small grey box of a UR10e, recordings of it, and datasets of those, without training."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from acqd.models.augmented import Term
from acqd.models.bundle.bundle import Bundle
from acqd.models.effects.scene import scene_of
from acqd.models.greybox.bundle_io import arrays_of
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import Layout, prior
from acqd.models.segments import Segment
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.dynamics import inertial_parameters
from acqd.robot.newton_euler import Chain
from tests.commands import acqd_here

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
    values[layout.part("coulomb")], values[layout.part("viscous")] = 5.0, 6.0
    values[layout.part("signals")], values[layout.part("lag")] = 4.0, 0.012
    return GreyBox(Chain.of(ROBOT), layout, values, STEP, np.ones(1))


def grey_bundle(reference=None, **more):
    """The same as a bundle."""
    return Bundle(about("grey_box", signals=["brake"], **more), arrays_of(grey()), reference)


def motion(rows, axes, seed):
    """Smooth motion that starts and ends at rest."""
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


def recording(model, number, add=None, *, rows=700, seed=0, start_s=1e9, slower=1.0):
    """What a meter would see: the model, coloured noise, and whatever `add` makes of the scene [T] (W).

    `slower`: the first part of the motion takes so many times as long.
    """
    random = np.random.default_rng([seed, number])
    q = motion(rows, model.axes, 100 * seed + number)
    if slower > 1:
        at = np.arange(rows) / slower
        q = np.column_stack([CubicSpline(np.arange(rows), column)(at) for column in q.T])
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


def term(name, shape=None, coefficient=2.0):
    return Term(name, "somewhere", dict(shape or {}), (0,), np.array([coefficient]), {})


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
    done = acqd_here(*merge, "--out", folder / "ds")
    assert done.returncode == 0, done.stderr
    return folder / "ds"
