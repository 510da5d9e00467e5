"""Columns of the base model: derivatives of its predicted power by its parameters, row by row.

Effects are not regressed on the residual alone, because a re-fitted model absorbs most of a missing effect (most of a
missing Coulomb friction or payload). Candidates compete while these columns are free.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import Lag, averaged
from acqd.models.greybox.model import magnitude
from acqd.robot.newton_euler import joint_torques

_LAG_STEP_S = 1e-3


def grey_box_columns(scene: Scene, withheld: frozenset[str] = frozenset()) -> Floats:
    """[T, parameters] W per unit of each parameter, in the model's layout.

    `withheld`: groups of parameters that the model was denied; the power of a torque lacks them.
    """
    model = scene.model
    layout = model.layout
    columns = np.zeros((scene.rows, layout.size))
    slope = scene.power_per_torque.copy()
    if "gain" in withheld:
        slope -= model.group("gain")[0] * scene.qd
    if "copper" in withheld:
        slope -= 2 * model.group("copper") * scene.tau
    lag_s = float(model.group("lag")[0])

    def fill(group: str, at_substeps: Floats) -> None:
        columns[:, layout.part(group)] = Lag(lag_s, scene.step_s).means(at_substeps)

    bodies = np.eye(10 * scene.axes)
    inertial = columns[:, layout.part("inertial")]
    for link in range(scene.axes):  # torques of all bodies at once would be the largest array of the loop
        of_link = slice(10 * link, 10 * link + 10)
        torques = joint_torques(model.chain, bodies[of_link], scene.q, scene.qd, scene.qdd, turned=scene.turned)
        inertial[:, of_link] = Lag(lag_s, scene.step_s).means(np.einsum("ktj,tj->tk", torques, slope))
    fill("rotor", slope * scene.qdd)
    fill("coulomb", slope * scene.direction)
    fill("viscous", slope * scene.qd)
    fill("copper", scene.tau**2)
    fill("conduction", magnitude(scene.tau))
    fill("gain", (scene.tau * scene.qd).sum(axis=1, keepdims=True))
    turned = slope * model.group("coulomb") * model.direction_slope(scene.qd)
    fill("sign_speed", turned.sum(axis=1, keepdims=True))
    faster, slower = max(lag_s - _LAG_STEP_S, 0.0), lag_s + _LAG_STEP_S
    change = Lag(slower, scene.step_s).run(scene.drives) - Lag(faster, scene.step_s).run(scene.drives)
    columns[:, layout.part("lag")] = averaged(change)[:, None] / (slower - faster)
    for name, place in zip(layout.signals, range(*layout.part("signals").indices(layout.size)), strict=True):
        columns[:, place] = averaged(scene.signals[name]) if name in scene.signals else 0.0
    columns[:, layout.part("standby")] = 1.0
    return columns
