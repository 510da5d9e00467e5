"""A motion that visits the described limits: sums of sines with random phases in every joint."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.robot.description import RobotDescription

STEP_S = 0.04
SECONDS = 60.0
_SHARE = 0.8  # of the speed and acceleration limits that the motion reaches
_TONES = 5
_SLOWEST_HZ, _FASTEST_HZ = 0.03, 0.5


def excitation(robot: RobotDescription, seed: int = 1) -> Floats:
    """Positions [T, axes] (rad or m) every STEP_S; limits, speeds and accelerations stay within the described ones."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, SECONDS, STEP_S)
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    for k in robot.sliding:
        low[k], high[k] = robot.lower[k], robot.upper[k]
    q = np.empty((len(t), robot.axes))
    for k in range(robot.axes):
        pulse = 2 * np.pi * np.exp(random.uniform(np.log(_SLOWEST_HZ), np.log(_FASTEST_HZ), _TONES))
        phase = random.uniform(0, 2 * np.pi, _TONES)
        weight = random.uniform(0.5, 1.0, _TONES) / pulse  # about equal speeds of all tones
        angle = pulse * t[:, None] + phase
        shape = np.sin(angle) @ weight
        speed, change = np.cos(angle) @ (weight * pulse), np.sin(angle) @ (weight * pulse**2)
        scale = min(
            (high[k] - low[k]) / np.ptp(shape),
            _SHARE * robot.speed[k] / np.abs(speed).max(),
            _SHARE * robot.acceleration[k] / np.abs(change).max(),
        )
        q[:, k] = (high[k] + low[k]) / 2 + scale * (shape - (shape.max() + shape.min()) / 2)
    return q
