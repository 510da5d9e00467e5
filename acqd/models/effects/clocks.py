"""The predicted power at shifted times."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import Lag, averaged

_STEP_S = 0.01


def later(scene: Scene, delays: Floats) -> Floats:
    """[T] W: the predicted power of every row `delays` [T] s earlier."""
    t = averaged(scene.t)
    return np.interp(t - delays, t, scene.predicted)


def slope(scene: Scene) -> Floats:
    """[T] W/s: time derivative of the predicted power, by a difference of two lags."""
    lag_s = float(scene.model.group("lag")[0])
    delayed = Lag(lag_s + _STEP_S, scene.step_s).means(scene.drives)
    return (Lag(lag_s, scene.step_s).means(scene.drives) - delayed) / _STEP_S
