"""Empirical Bayes: the prior of a type's grey-box parameters from the bundles of its robots.

The parameters of robot i are taken as a draw from a normal distribution whose mean and covariance are estimated from
the n robots of the type (parametric empirical Bayes, Morris 1983). With more parameters than robots the sample
covariance is singular: its correlations are shrunk towards zero by the analytic weight of Schaefer and Strimmer (2005),
its variances are kept. For a further robot, the covariance of the predictive Student distribution counts: (1 + 1/n)
(n-1)/(n-3) times the estimate. Errors of the n fits are part of the scatter, so that the prior is rather too wide.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError, UserError
from acqd.fleet.settings import Fleet
from acqd.models.bundle.bundle import load_bundle
from acqd.models.greybox.fleet_prior import FleetPrior

FEWEST = 5
"""Robots of a type from which a prior can be learned."""
_LEAST_SPREAD = 1e-6
"""Relative to the parameter: keeps the covariance regular where all robots agree."""
_LEAST_SHARE = 0.1
"""Least spread between robots, as a share of the error of one robot's fit."""


def priors_of(fleet: Fleet, leave_out: Path | None = None) -> dict[str, FleetPrior]:
    """A prior for every type of which the fleet has enough grey boxes; `leave_out`: a bundle that takes no part."""
    own = None if leave_out is None else leave_out.absolute()
    types: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for robot in fleet.robots:
        if own is not None and robot.model.resolve() == own.resolve():
            continue
        try:
            metadata = load_bundle(robot.model).metadata
        except InputError:
            continue  # its line in the table says so
        if "parameters" in metadata and not metadata.get("withheld"):
            types.setdefault(str(metadata["robot"]), {})[robot.name] = metadata["parameters"]
    return {name: _prior(name, tables) for name, tables in types.items() if len(tables) >= FEWEST}


def prior_for(fleet: Fleet, robot: str, leave_out: Path) -> FleetPrior:
    """The prior of one type. Raises UserError where the fleet has too few bundles of it."""
    found = priors_of(fleet, leave_out)
    if robot not in found:
        raise UserError(
            f"{fleet.path}: has no {FEWEST} grey boxes of {robot} other than {leave_out}, too few for a prior; "
            "train without --prior"
        )
    return found[robot]


def _prior(robot: str, tables: dict[str, list[dict[str, Any]]]) -> FleetPrior:
    """Of tables of parameters by the robot's name; parameters that not all robots have are left out."""
    common = set.intersection(*({entry["name"] for entry in table} for table in tables.values()))
    names = [entry["name"] for entry in next(iter(tables.values())) if entry["name"] in common]
    values = np.array([_values(table, names) for table in tables.values()])
    mean, covariance = estimated(values, np.array([_errors(table, names) for table in tables.values()]).mean(axis=0))
    return FleetPrior(robot, tuple(names), mean, covariance, tuple(tables))


def _values(table: Iterable[dict[str, Any]], names: list[str]) -> list[float]:
    known = {entry["name"]: float(entry["value"]) for entry in table}
    return [known[name] for name in names]


def _errors(table: Iterable[dict[str, Any]], names: list[str]) -> list[float]:
    """Standard errors; 0 where a bundle has no interval."""
    known = {entry["name"]: entry["ci95"] for entry in table}
    return [(known[name][1] - known[name][0]) / 3.92 if known[name] else 0.0 for name in names]


def estimated(values: Floats, errors: Floats) -> tuple[Floats, Floats]:
    """Mean [p] and predictive covariance [p, p] of a further row, from rows [n, p], n >= FEWEST.

    `errors`: [p] standard error of a row. Robots that agree by far better than that do so by their common prior.
    """
    count = len(values)
    mean = values.mean(axis=0)
    least = np.maximum(_LEAST_SHARE * errors, _LEAST_SPREAD * np.maximum(np.abs(mean), 1.0))
    spread = np.maximum(values.std(axis=0, ddof=1), least)
    z = (values - mean) / spread
    correlations = shrunk_correlations(z)
    factor = (1 + 1 / count) * (count - 1) / (count - 3)
    return mean, factor * correlations * np.outer(spread, spread)


def shrunk_correlations(z: Floats) -> Floats:
    """Correlations [p, p] of standardised rows [n, p], shrunk towards zero (Schaefer and Strimmer 2005, target D)."""
    count = len(z)
    products = z[:, :, None] * z[:, None, :]
    r = products.mean(axis=0) * count / (count - 1)
    variance = count / (count - 1) ** 3 * ((products - products.mean(axis=0)) ** 2).sum(axis=0)
    off = ~np.eye(z.shape[1], dtype=bool)
    weight = float(np.clip(variance[off].sum() / max((r[off] ** 2).sum(), 1e-12), 0.0, 1.0)) if off.any() else 1.0
    shrunk = (1 - weight) * r
    np.fill_diagonal(shrunk, 1.0)
    return np.asarray(shrunk)
