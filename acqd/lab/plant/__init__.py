"""The physics of the virtual cell, from joint motion to power drawn from the mains.

Apart from everything that analyses: nothing outside `acqd.lab` and `acqd.cli` may import it.
"""

from acqd.lab.plant.plant import Plant, PlantTrace
from acqd.lab.plant.situation import Effect, Situation, Stretch

__all__ = ["Effect", "Plant", "PlantTrace", "Situation", "Stretch"]
