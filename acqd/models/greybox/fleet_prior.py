"""A prior of grey-box parameters that other robots of the type have taught: a normal distribution with covariance."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from acqd.arrays import Floats
from acqd.atomic import write_complete
from acqd.errors import InputError
from acqd.models.greybox.parameters import Layout, Prior

_FORMAT = 1


@dataclass(frozen=True, slots=True)
class FleetPrior:
    """Mean and covariance over the robots of a type."""

    robot: str
    """Type: the name of the description."""
    names: tuple[str, ...]
    """[p] of the parameters."""
    mean: Floats
    """[p]."""
    covariance: Floats
    """[p, p], of a further robot's parameters about the mean."""
    robots: tuple[str, ...]
    """Bundles that it was learned from."""
    inflation: float = 1.0
    """How much more the robots' recordings claimed to know than they did (median): a new robot's claim as much."""

    def on(self, described: Prior, layout: Layout) -> Prior:
        """The prior of a fit: the fleet's where it knows a parameter, the description's elsewhere."""
        names = [name for name, _ in layout.names()]
        place = {name: k for k, name in enumerate(self.names)}
        known = np.array([k for k, name in enumerate(names) if name in place], dtype=int)
        own = np.array([place[names[k]] for k in known], dtype=int)
        mean, precision = described.mean.copy(), described.precision_matrix()
        mean[known] = self.mean[own]
        precision[np.ix_(known, known)] = np.linalg.inv(self.covariance[np.ix_(own, own)])
        return Prior(mean, described.deviation, precision)

    def provenance(self) -> dict[str, Any]:
        """The entry of bundle.json."""
        return {"robot": self.robot, "robots": list(self.robots), "method": "empirical Bayes"}

    def write(self, path: Path) -> None:
        """Write the prior as JSON. Raises OperationError."""
        content = {
            "format": _FORMAT, "robot": self.robot, "names": self.names, "mean": self.mean,
            "covariance": self.covariance, "robots": self.robots, "inflation": self.inflation,
        }  # fmt: skip
        write_complete(path, orjson.dumps(content, option=orjson.OPT_SERIALIZE_NUMPY))

    @classmethod
    def read(cls, path: Path) -> FleetPrior:
        """The inverse of `write`. Raises InputError."""
        try:
            content = orjson.loads(path.read_bytes())
            if content["format"] != _FORMAT:
                raise ValueError(f"format {content['format']!r}, expected {_FORMAT}")
            mean, covariance = np.array(content["mean"], float), np.array(content["covariance"], float)
            count = len(content["names"])
            if mean.shape != (count,) or covariance.shape != (count, count):
                raise ValueError(f"{count} names, a mean of {mean.shape} and a covariance of {covariance.shape}")
            np.linalg.cholesky(covariance)
            names, robots = tuple(content["names"]), tuple(content["robots"])
            return cls(content["robot"], names, mean, covariance, robots, float(content.get("inflation", 1.0)))
        except OSError as error:
            raise InputError(path, f"cannot be read ({error.strerror})") from None
        except (orjson.JSONDecodeError, KeyError, TypeError, ValueError, np.linalg.LinAlgError) as error:
            raise InputError(path, f"is no prior of a fleet ({error}); acqd fleet writes one per type") from None
