"""Columns of the base model: its derivative by each of its parameters, row by row.

A missing effect is never regressed on the residual: re-fitting the model absorbs most of it (Coulomb friction 96 %,
payload 91 % in ../shared/notes/residual.md). Candidates compete with these columns free.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import Lag, averaged
from acqd.models.greybox.model import GreyBox, direction, magnitude
from acqd.robot.arm import Arm
from acqd.robot.dynamics import regressor

_LAG_STEP_S = 1e-3


def base_columns(arm: Arm, scene: Scene, withheld: frozenset[str] = frozenset()) -> Floats:
    """[T, parameters] in the model's layout, W per unit of each parameter; a torque's power lacks what is withheld."""
    model = scene.model
    layout = model.layout
    fine = np.zeros((len(scene.q), layout.size))
    pull = scene.power_per_torque.copy()
    if "gain" in withheld:
        pull -= model.group("gain")[0] * scene.qd
    if "copper" in withheld:
        pull -= 2 * model.group("copper") * scene.tau
    Y = regressor(arm, scene.q, scene.qd, scene.qdd)
    fine[:, layout.place("inertial")] = np.einsum("tjk,tj->tk", Y, pull, optimize=True)
    fine[:, layout.place("rotor")] = pull * scene.qdd
    fine[:, layout.place("coulomb")] = pull * direction(scene.qd)
    fine[:, layout.place("viscous")] = pull * scene.qd
    fine[:, layout.place("copper")] = scene.tau**2
    fine[:, layout.place("conduction")] = magnitude(scene.tau)
    fine[:, layout.place("gain")] = (scene.tau * scene.qd).sum(axis=1, keepdims=True)
    lag_s = float(model.group("lag")[0])
    columns = averaged(Lag(lag_s, scene.step_s).run(fine))
    faster, slower = max(lag_s - _LAG_STEP_S, 0.0), lag_s + _LAG_STEP_S
    change = Lag(slower, scene.step_s).run(scene.drives) - Lag(faster, scene.step_s).run(scene.drives)
    columns[:, layout.place("lag")] = averaged(change)[:, None] / (slower - faster)
    for name, place in zip(layout.signals, range(*layout.place("signals").indices(layout.size)), strict=True):
        columns[:, place] = averaged(scene.signals[name]) if name in scene.signals else 0.0
    columns[:, layout.place("standby")] = 1.0
    return columns


def deviations(model: GreyBox, prior_deviation: Floats) -> Floats:
    """[parameters] how far each may move: the prior's, or less where it is endless."""
    finite = np.isfinite(prior_deviation)
    return np.where(finite, prior_deviation, 1e3 * np.maximum(np.abs(model.values), 1.0))
