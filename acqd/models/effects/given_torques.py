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
    def count(self, scene: Scene) -> int:
        """Number of columns."""

    @abstractmethod
    def torque_of(self, scene: Scene, column: int) -> Floats:
        """[N, axes] Nm per unit of a column; one at a time, since a search of one place asks for its columns only."""

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, k] W per unit of each column."""
        return self.some(scene, shape, slice(None))

    def some(self, scene: Scene, shape: Shape, columns: Sequence[int] | slice) -> Floats:
        """[N, k] W per unit of chosen columns."""
        chosen = range(self.count(scene))[columns] if isinstance(columns, slice) else columns
        power = np.empty((len(scene.q), len(chosen)))
        for out, column in zip(power.T, chosen, strict=True):
            np.einsum("nj,nj->n", scene.power_per_torque, self.torque_of(scene, column), out=out)
        return power

    def torque(self, scene: Scene, shape: Shape, columns: Sequence[int], coefficients: Floats) -> Floats:
        """The sum of the columns' torques."""
        pairs = zip(columns, coefficients, strict=True)
        return np.asarray(sum((float(value) * self.torque_of(scene, k) for k, value in pairs), np.zeros_like(scene.q)))
