"""Effects whose columns are torques that follow from the motion alone: their power at the scene's power per torque."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Shape
from acqd.models.effects.scene import Scene


class GivenTorques(Effect):
    """An effect of torques without a shape."""

    acts_on = "torque"

    @abstractmethod
    def torques(self, scene: Scene) -> Sequence[Floats]:
        """[N, axes] Nm per unit of each column, made when they are asked for where that takes long."""

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, k] W per unit of each column."""
        return self.some(scene, shape, slice(None))

    def some(self, scene: Scene, shape: Shape, columns: Sequence[int] | slice) -> Floats:
        """[N, k] W per unit of chosen columns."""
        every = self.torques(scene)
        numbers = range(len(every))[columns] if isinstance(columns, slice) else columns
        power = np.empty((len(scene.q), len(numbers)))
        for out, k in zip(power.T, numbers, strict=True):
            np.einsum("nj,nj->n", scene.power_per_torque, every[k], out=out)
        return power

    def torque(self, scene: Scene, shape: Shape, columns: Sequence[int], coefficients: Floats) -> Floats:
        """The sum of the columns' torques."""
        every = self.torques(scene)
        pairs = zip(columns, coefficients, strict=True)
        return np.asarray(sum((float(value) * every[column] for column, value in pairs), np.zeros_like(scene.q)))
