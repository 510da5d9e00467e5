"""Effects whose columns are torques that follow from the motion alone: their power at the scene's power per torque."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.bodies import powers
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Shape
from acqd.models.effects.scene import Scene


class GivenTorques(Effect):
    """An effect of torques without a shape."""

    acts_on = "torque"

    @abstractmethod
    def torques(self, scene: Scene) -> Sequence[Floats]:
        """[k, N, axes] Nm per unit of each column, in one array or in several."""

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, k] W per unit of each column."""
        return np.concatenate([powers(scene, each) for each in self.torques(scene)], axis=1)

    def torque(self, scene: Scene, shape: Shape, columns: Sequence[int], coefficients: Floats) -> Floats:
        """The sum of the columns' torques."""
        every = [torque for each in self.torques(scene) for torque in each]
        pairs = zip(columns, coefficients, strict=True)
        return np.asarray(sum((float(value) * every[column] for column, value in pairs), np.zeros_like(scene.q)))
