"""Random states of a robot."""

import numpy as np

from acqd.robot import shipped_descriptions

ROBOTS = shipped_descriptions()


def states(robot, count=200, seed=0):
    random = np.random.default_rng(seed)
    q = random.uniform(robot.lower, robot.upper, (count, robot.axes))
    return q, random.normal(size=q.shape), random.normal(size=q.shape) * 3
