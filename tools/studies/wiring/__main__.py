"""How often miswired transformers are named, and how often a healthy site is warned of (simulated samples).

    python -m tools.studies.wiring [--sites 5] [--healthy 100] [--seed 0] [--json FILE]

Every site is a second of samples with harmonics, noise and the angle errors of transformers, in which a motor drive, a
heater or single-phase loads draw power; six orders of the current transformers, each right or with one reversed, make
24 wirings of it. Healthy sites have any balance and power factor, also single-phase loads on the three phases,
capacitors and a load that feeds back.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from itertools import permutations
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from acqd.metering.phasors import Phasors, phasors
from acqd.metering.wiring_check import examine

RATE, F = 6_400.0, 50.0
POWER_FACTORS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
SIGNS = ((1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1))
LEFT = 0.15
"""Share of the healthy sites with a rotating field to the left."""


@dataclass(frozen=True)
class Score:
    """One line of the table."""

    site: str
    cases: int
    right: int
    wrong: int
    """Another wiring was named."""
    silent: int


def samples(random: np.random.Generator, lag: np.ndarray, amperes: np.ndarray, left: bool = False) -> np.ndarray:
    """[samples, 6] of u1, i1, u2 ...; `lag` [rad] and `amperes` (RMS) of each phase."""
    t = np.arange(round(RATE)) / RATE
    f = F + random.normal(0, 0.03)
    shift = -2 * np.pi * np.arange(3) / 3 * (-1 if left else 1) + random.normal(0, np.radians(0.7), 3)
    volts = 230 * random.normal(1.0, 0.03) * (1 + random.normal(0, 0.012, 3))
    error = random.normal(0, np.radians(0.8), 3)  # of the transformers
    fifth, third = random.uniform(0, 0.3), random.uniform(0, 0.1)
    wave = np.empty((len(t), 6))
    for k in range(3):
        angle = 2 * np.pi * f * t + shift[k]
        wave[:, 2 * k] = np.sqrt(2) * volts[k] * (np.cos(angle) + 0.02 * np.cos(5 * angle + 0.4))
        drawn = angle - lag[k] - error[k]
        current = np.cos(drawn) + fifth * np.cos(5 * drawn + 1.0) + third * np.cos(3 * drawn)
        wave[:, 2 * k + 1] = np.sqrt(2) * amperes[k] * current
    wave[:, 0::2] += random.normal(0, 0.5, (len(t), 3))
    wave[:, 1::2] += random.normal(0, 0.002 * amperes.max(), (len(t), 3))
    return wave


def load(random: np.random.Generator, pf: float, unbalance: float) -> tuple[np.ndarray, np.ndarray]:
    """Angles [rad] and currents [A] of three phases."""
    lag = np.arccos(pf) + random.normal(0, np.radians(1 + 4 * unbalance), 3)
    return lag, random.uniform(1, 60) * (1 + unbalance * random.uniform(-1, 1, 3))


def miswired(random: np.random.Generator, unbalance: float, known: bool, sites: int) -> Score:
    """24 wirings of every site."""
    right = wrong = cases = 0
    for pf in POWER_FACTORS:
        for _ in range(sites):
            true = phasors(samples(random, *load(random, pf, unbalance)), RATE, F)
            power = float((true.U * true.I.conj()).real.sum())
            model = power * random.normal(1.0, 0.03) if known else None
            for order in permutations(range(3)):
                for sign in SIGNS:
                    measured = np.empty(3, complex)
                    for k in range(3):
                        measured[order[k]] = true.I[k] * sign[k]
                    said = [(one.order, one.sign) for one in examine(Phasors(true.U, measured), model)]
                    plain = order == (0, 1, 2) and sign == (1, 1, 1)
                    expected = [] if plain else [(tuple(k + 1 for k in order), sign)]
                    cases += 1
                    right += said == expected
                    wrong += bool(said) and said != expected
    title = f"unbalance {100 * unbalance:.0f} %, load {'known within 3 %' if known else 'unknown'}"
    return Score(title, cases, right, wrong, cases - right - wrong)


def healthy(random: np.random.Generator, number: int, known: bool) -> Score:
    """Sites without a mistake; `wrong` counts the warnings."""
    warned = 0
    for site in range(number):
        kind = site % 4
        lag, amperes = load(random, random.uniform(0.2, 1.0), random.uniform(0, 0.5))
        if kind == 1:  # three single-phase loads
            lag, amperes = np.radians(random.uniform(-30, 70, 3)), random.uniform(0.5, 20, 3)
        elif kind == 2:  # a drive that brakes into the mains
            lag = np.pi + np.radians(random.uniform(-8, 8)) + random.normal(0, np.radians(1), 3)
        elif kind == 3:  # capacitors of an EMC filter beside a small load
            lag = np.radians(random.uniform(-30, 0)) + random.normal(0, np.radians(2), 3)
        found = phasors(samples(random, lag, amperes, random.uniform() < LEFT), RATE, F)
        power = float((found.U * found.I.conj()).real.sum())
        warned += bool(examine(found, power if known else None))
    title = f"healthy, load {'known' if known else 'unknown'}"
    return Score(title, number, number - warned, warned, 0)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", type=int, default=5, help="of each power factor")
    parser.add_argument("--healthy", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    random = np.random.default_rng(arguments.seed)
    scores = [miswired(random, share, known, arguments.sites) for share in (0.0, 0.1, 0.3) for known in (False, True)]
    scores += [healthy(random, arguments.healthy, known) for known in (False, True)]
    table = Table("site (simulated)", "cases", "right", "%", "wrong", "silent")
    for one in scores:
        cells = (one.cases, one.right, f"{100 * one.right / one.cases:.2f}", one.wrong, one.silent)
        table.add_row(one.site, *map(str, cells))
    Console(width=110).print(table)
    if arguments.json is not None:
        arguments.json.write_text(json.dumps([asdict(one) for one in scores], indent=1) + "\n")


if __name__ == "__main__":
    main()
