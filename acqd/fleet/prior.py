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
from acqd.models.greybox.gain_basis import compared, original, powers
from acqd.models.greybox.likelihood import Likelihood
from acqd.models.greybox.parameters import Layout

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
    power: Floats
    """[p] of the gain (see `gain_basis`)."""
    likelihood: Likelihood

    @property
    def gain(self) -> int:
        """Place of the gain."""
        return self.names.index("gain")


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
    layout = Layout(
        int(bundle.metadata["axes"]), tuple(bundle.metadata["signals"]), tuple(bundle.metadata.get("sliding", ()))
    )
    names = [entry["name"] for entry in table]
    power = powers(layout)[: len(names)]  # an earlier version has no estimate of the last parameter
    return _Robot(names, power, _from_intervals(table) if known is None else known)


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
    first, *_ = members = list(robots.values())
    common = set.intersection(*(set(each.names) for each in members))
    names = [name for name in first.names if name in common]
    places = [np.array([each.names.index(name) for name in names]) for each in members]
    mean = np.mean([each.likelihood.mean[place] for each, place in zip(members, places, strict=True)], axis=0)
    deviation = np.median(
        [each.likelihood.deviation[place] for each, place in zip(members, places, strict=True)], axis=0
    )
    gain = names.index("gain")
    evidence = [_evidence(each, place, float(mean[gain])) for each, place in zip(members, places, strict=True)]
    taught = learned(evidence, mean, deviation, [name.split(".")[0] for name in names])
    values, slope = original(taught.mean, first.power[places[0]], gain, float(mean[gain]))
    inflation = float(np.median([each.likelihood.inflation for each in members]))
    return FleetPrior(robot, tuple(names), values, slope @ taught.predictive() @ slope.T, tuple(robots), inflation)


def _evidence(robot: _Robot, kept: Any, common_gain: float) -> Evidence:
    """Of some parameters at the common gain; the others are integrated out, with the description's prior of these."""
    known = robot.likelihood
    values, slope = compared(known.values, robot.power, robot.gain, common_gain)
    back = np.linalg.inv(slope)
    information = back.T @ known.information @ back
    shift = information @ values + back.T @ known.score
    left = np.setdiff1d(np.arange(len(shift)), kept)
    across: Floats = information[np.ix_(kept, left)]
    precision = known.deviation[left] ** -2.0
    own = information[np.ix_(left, left)] + np.diag(precision)
    return Evidence(
        information[np.ix_(kept, kept)] - across @ np.linalg.solve(own, across.T),
        shift[kept] - across @ np.linalg.solve(own, shift[left] + precision * known.mean[left]),
    )
