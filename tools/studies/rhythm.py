"""How far the probability of a rhythm can be believed, of loads that no assumption of acqd made (simulated states).

    python -m tools.studies.rhythm [--loads 40] [--seed 0] [--json]

Thermostats keep two lengths of stay that drift with the day and scatter little. Equipment is used at random: stays of
an exponential, a log-normal, a uniform, or one of two lengths. All are recorded every 40 ms in recordings with pauses,
and noise turns rows and short stays around. Prints the share of thermostats by said probability, the Brier score (0.25
knows nothing), and how far periods are off.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from acqd.arrays import Floats
from acqd.discrepancy.selection.detectors.rhythm import rhythm
from acqd.report.digits import percent
from tools.common.tables import show

STEP_S = 0.04
SCATTERS = (0.0, 0.05, 0.12)
"""Of the stays of a thermostat."""
CYCLE_S = (8.0, 300.0)
RECORDINGS, RECORDING_S, PAUSE_S = (3, 12), (45.0, 180.0), (1.0, 600.0)
NOISES = ("none", "rows", "stays")
BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0 + 1e-9)

Stay = Callable[[np.random.Generator, float], float]
EQUIPMENT: dict[str, Stay] = {
    "exponential": lambda random, mean: random.exponential(mean),
    "log-normal": lambda random, mean: mean * random.lognormal(-0.245, 0.7),
    "uniform": lambda random, mean: random.uniform(0.1, 1.9) * mean,
    "one of two": lambda random, mean: mean * random.choice((0.4, 1.6)) * random.normal(1, 0.05),
}


def switchings(kind: str, random: np.random.Generator, until_s: float) -> tuple[Floats, float]:
    """Times in s at which a load switches, the first to on, and its mean period in s."""
    period = float(np.exp(random.uniform(*np.log(CYCLE_S))))
    duty, scatter, drift = random.uniform(0.2, 0.8), random.choice(SCATTERS), random.uniform(-0.1, 0.1)
    times = [-random.uniform(0, period)]
    while times[-1] < until_s:
        mean = period * (duty if len(times) % 2 else 1 - duty)
        if kind in EQUIPMENT:
            stay = EQUIPMENT[kind](random, mean)
        else:
            stay = mean * (1 + drift * times[-1] / until_s) * random.normal(1, scatter)
        times.append(times[-1] + max(stay, 0.2))
    return np.array(times), period


def recorded(at_s: Floats, random: np.random.Generator, noise: str) -> tuple[list[np.ndarray], list[Floats]]:
    """States [T] and times [T] in s of every recording."""
    states, times, begin = [], [], 0.0
    for _ in range(int(random.integers(*RECORDINGS))):
        t = np.arange(begin, begin + random.uniform(*RECORDING_S), STEP_S)
        on = np.searchsorted(at_s, t) % 2 == 1
        if noise == "rows":
            on = on ^ (random.random(len(t)) < random.uniform(0.001, 0.02))
        for start in random.integers(0, len(t), random.poisson(len(t) * STEP_S / 40) if noise == "stays" else 0):
            on[start : start + round(random.uniform(0.1, 3.0) / STEP_S)] ^= True
        states.append(on)
        times.append(t)
        begin = float(t[-1]) + random.uniform(*PAUSE_S)
    return states, times


def judged(kind: str, noise: str, random: np.random.Generator) -> tuple[float, float] | None:
    """The said probability and the period's relative error; None of a load that did not switch in the recordings."""
    at_s, period_s = switchings(kind, random, RECORDINGS[1] * (RECORDING_S[1] + PAUSE_S[1]))
    on, t = recorded(at_s, random, noise)
    if sum(int(np.abs(np.diff(each.astype(int))).sum()) for each in on) < 4:
        return None
    said = rhythm(on, t)
    return said.probability, said.period_s / period_s - 1


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--loads", type=int, default=40, help="of each kind of equipment and noise (default 40)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    kinds = [*EQUIPMENT, *["thermostat"] * len(EQUIPMENT)]  # equally likely
    plan = [(number, kind, noise) for number in range(chosen.loads) for kind in kinds for noise in NOISES]
    rows: list[dict[str, Any]] = []
    for place, (_, kind, noise) in enumerate(track(plan, "loads", console=Console(stderr=True))):
        found = judged(kind, noise, np.random.default_rng([chosen.seed, place]))
        if found is not None:
            rows.append({"kind": kind, "noise": noise, "probability": found[0], "period_error": found[1]})
    if chosen.json:
        print(json.dumps({"simulated": True, "loads": rows}))
        return
    said = np.array([row["probability"] for row in rows])
    true = np.array([row["kind"] == "thermostat" for row in rows])
    table = Table("probability said (simulated)", "loads", "thermostats", "share")
    for low, high in pairwise(BINS):
        within = (said >= low) & (said < high)
        share = percent(true[within].mean()) if within.any() else ""
        table.add_row(f"{percent(low)} to {percent(min(high, 1))}", str(within.sum()), str(true[within].sum()), share)
    show(table, width=100)
    scores = Table("kind", *NOISES, title="Brier score")
    for kind in (*EQUIPMENT, "thermostat"):
        of = [[row["probability"] for row in rows if (row["kind"], row["noise"]) == (kind, noise)] for noise in NOISES]
        scores.add_row(kind, *(f"{np.mean((np.array(each) - (kind == 'thermostat')) ** 2):.3f}" for each in of))
    show(scores, width=100)
    named = [row for row in rows if row["kind"] == "thermostat" and row["probability"] > 0.5]
    near = sum(abs(row["period_error"]) < 0.1 for row in named)
    print(f"Brier score {np.mean((said - true) ** 2):.3f}; {near} of {len(named)} named periods are within 10 %")


if __name__ == "__main__":
    main()
