"""Motions of an iiwa, and its power by expressions other than the models'."""

from pathlib import Path

import numpy as np

from acqd.models.features import motion
from acqd.models.predictor import Stream
from acqd.models.segments import Dataset, Segment
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.dynamics import inverse_dynamics

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


def streamed(model, q, signals=None):
    stream = Stream(model)
    each = [stream.step(row, None if signals is None else signals[k]) for k, row in enumerate(q)]
    return np.array([value for value in each if value is not None] + stream.finish())


def iiwa_power(q, seed=None, direction=np.sign):
    """Another expression of a robot's power: Pinocchio, straight signs, a lag by Euler's rule in tenths of a step."""
    description = load_description("iiwa7_r800")
    _, qd, qdd = motion(q, STEP)
    tau = 1.04 * inverse_dynamics(Arm(description), q, qd, qdd)
    motor = tau + 2.0 * qdd + 6.0 * direction(qd) + 8.0 * qd
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
