"""The physics of the virtual cell, from joint motion to power drawn from the mains.

Separate from all analyses: only `acqd.lab` and `acqd.cli` may import it.
"""

from acqd.lab.plant.plant import Plant, PlantTrace
from acqd.lab.plant.situation import Effect, Situation, Stretch

__all__ = ["Effect", "Plant", "PlantTrace", "Situation", "Stretch"]
