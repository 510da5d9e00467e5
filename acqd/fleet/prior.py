"""The prior of a type's grey-box parameters from the bundles of its robots (see `empirical_bayes`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError, UserError
from acqd.fleet.empirical_bayes import Evidence, learned
from acqd.fleet.settings import Fleet
from acqd.models.bundle.bundle import Bundle, load_bundle
from acqd.models.greybox.fleet_prior import FleetPrior
from acqd.models.greybox.likelihood import Likelihood

FEWEST = 5
"""Robots of a type from which a prior can be learned."""
_MOST = 40
"""Further ones teach little, and each takes time."""
_LEAST_DEVIATION = 1e-6
"""Of a parameter from a bundle without intervals, relative to it: keeps information finite."""


@dataclass(frozen=True, slots=True)
class _Robot:
    """What one bundle says."""

    names: list[str]
    """[p] of the parameters."""
    likelihood: Likelihood


def priors_of(fleet: Fleet, leave_out: Path | None = None) -> dict[str, FleetPrior]:
    """A prior for every type of which the fleet has enough grey boxes; `leave_out`: a bundle that takes no part."""
    own = None if leave_out is None else leave_out.absolute()
    types: dict[str, dict[str, _Robot]] = {}
    for robot in fleet.robots:
        if own is not None and robot.model.resolve() == own.resolve():
            continue
        try:
            bundle = load_bundle(robot.model)
        except InputError:
            continue  # its line in the table says so
        if "parameters" in bundle.metadata and not bundle.metadata.get("withheld"):
            types.setdefault(str(bundle.metadata["robot"]), {})[robot.name] = _robot(bundle)
    return {name: _prior(name, _some(robots)) for name, robots in types.items() if len(robots) >= FEWEST}


def prior_for(fleet: Fleet, robot: str, leave_out: Path) -> FleetPrior:
    """The prior of one type. Raises UserError where the fleet has too few bundles of it."""
    found = priors_of(fleet, leave_out)
    if robot not in found:
        raise UserError(
            f"{fleet.path}: has no {FEWEST} grey boxes of {robot} other than {leave_out}, too few for a prior; "
            "train without --prior"
        )
    return found[robot]


def _robot(bundle: Bundle) -> _Robot:
    """A bundle of an earlier version has its estimates and intervals only."""
    table = bundle.metadata["parameters"]
    known = Likelihood.read(bundle.arrays)
    return _Robot([entry["name"] for entry in table], _from_intervals(table) if known is None else known)


def _from_intervals(table: Sequence[dict[str, Any]]) -> Likelihood:
    values = np.array([float(entry["value"]) for entry in table])
    least = _LEAST_DEVIATION * np.maximum(np.abs(values), 1.0)
    errors = np.array([(entry["ci95"][1] - entry["ci95"][0]) / 3.92 if entry["ci95"] else 0.0 for entry in table])
    information = np.diag(np.maximum(errors, least) ** -2.0)
    wide = np.maximum(np.abs(values), 10 * errors) + least  # stands for the description's, which is not known here
    return Likelihood(values, information, np.zeros(len(values)), values, wide, 1.0)


def _some(robots: dict[str, _Robot]) -> dict[str, _Robot]:
    """At most so many, evenly over the file."""
    names = list(robots)
    chosen = np.unique(np.linspace(0, len(names) - 1, min(len(names), _MOST)).round().astype(int))
    return {names[k]: robots[names[k]] for k in chosen}


def _prior(robot: str, robots: dict[str, _Robot]) -> FleetPrior:
    """Of the parameters that all robots have."""
    common = set.intersection(*(set(each.names) for each in robots.values()))
    names = [name for name in next(iter(robots.values())).names if name in common]
    places = [[each.names.index(name) for name in names] for each in robots.values()]
    likelihoods = [each.likelihood for each in robots.values()]
    mean = np.mean([one.mean[place] for one, place in zip(likelihoods, places, strict=True)], axis=0)
    deviation = np.median([one.deviation[place] for one, place in zip(likelihoods, places, strict=True)], axis=0)
    evidence = [_evidence(one, place) for one, place in zip(likelihoods, places, strict=True)]
    taught = learned(evidence, mean, np.asarray(deviation), [name.split(".")[0] for name in names])
    inflation = float(np.median([one.inflation for one in likelihoods]))
    return FleetPrior(robot, tuple(names), taught.mean, taught.predictive(), tuple(robots), inflation)


def _evidence(likelihood: Likelihood, place: list[int]) -> Evidence:
    """Of some parameters; the others are integrated out, with the description's prior of these."""
    information, shift = likelihood.information, likelihood.shift
    kept = np.array(place)
    left = np.setdiff1d(np.arange(len(shift)), kept)
    across: Floats = information[np.ix_(kept, left)]
    precision = likelihood.deviation[left] ** -2.0
    own = information[np.ix_(left, left)] + np.diag(precision)
    return Evidence(
        information[np.ix_(kept, kept)] - across @ np.linalg.solve(own, across.T),
        shift[kept] - across @ np.linalg.solve(own, shift[left] + precision * likelihood.mean[left]),
    )
