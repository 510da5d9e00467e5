"""A motion of the iiwa, and the power that its plant takes for it."""

import itertools

import numpy as np

from acqd.lab.cell import build_cell
from acqd.lab.effects import make_effects, parse_effect
from acqd.lab.plant import Plant, Stretch
from acqd.lab.settings import LabSettings
from acqd.motion.controller import Controller, Move, SwitchTool, Wait
from acqd.robot import load_description

IIWA = load_description("iiwa7_r800")


CELL = build_cell(LabSettings())


def motion_of(cell, seed=0, moves=6, tool=True):
    random = np.random.default_rng(seed)
    robot = cell.robot
    targets = random.uniform(np.maximum(robot.lower, -2), np.minimum(robot.upper, 2), (moves, robot.axes)) * 0.6
    program = [Wait(1.0)]
    for number, target in enumerate(targets):
        program.append(Move(target, float(random.uniform(0.2, 0.5)), 0.2, 0.8))
        if tool and number == 2:
            program += [SwitchTool(True), Wait(0.3)]
    program += [SwitchTool(False), Wait(12.0)]
    return Controller(robot, np.zeros(robot.axes)).run(program)


MOTION = motion_of(CELL)


VOLTAGE = 230 + 2 * np.sin(np.arange(len(MOTION)) * 2e-4)


def run(effects=(), motion=MOTION, cell=CELL, pieces=1):
    plant = Plant(cell.true_arm, cell.parameters, effects)
    edges = np.linspace(0, len(motion), pieces + 1).astype(int)
    power = [plant.run(motion.part(a, b), VOLTAGE[a:b], Stretch(a / 1000)).power for a, b in itertools.pairwise(edges)]
    return plant, np.concatenate(power)


CLEAN = run()[1]


def power_of(order, motion=MOTION, voltage=VOLTAGE, stretch=None):
    plant = Plant(CELL.true_arm, CELL.parameters, make_effects([parse_effect(order)], [1]))
    clean = Plant(CELL.true_arm, CELL.parameters)
    return plant.run(motion, voltage, stretch).power - clean.run(motion, voltage, stretch).power
