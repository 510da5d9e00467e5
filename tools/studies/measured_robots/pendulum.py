"""A servo with a pendulum: is a heavier bob named, with the right first moment, and are unchanged runs silent?

    python -m tools.studies.measured_robots.pendulum OUT [--data ../shared/data/robots/servo_pendulum]

The motion is measured, the power derived from the servo's duty and voltage. Model and reference are the runs with
0.535 kg; the question is about those with 0.741 kg, a first moment of 0.0206 kg m more. Then every other run with 0.535
kg is judged by a model of the others, in both directions. The drive is guessed ([pendulum.toml](pendulum.toml)).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from rich.table import Table
from scipy.signal import medfilt, savgol_filter

from acqd.cli.main import for_people
from acqd.dataset.build import build
from acqd.dataset.config import BuildConfig
from acqd.discrepancy.closed import Closed
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import close_loop
from acqd.models.config import TrainConfig
from acqd.models.training import train_one
from acqd.report.digits import percent
from tools.common.tables import show

DESCRIPTION = Path(__file__).with_name("pendulum.toml")
DATA = Path(__file__).parents[4] / "shared" / "data" / "robots" / "servo_pendulum"
TRUE_KG_M = 0.0206
MOMENT = "first moment about the last axis"
_LAG_S = 0.024
"""Positions are as much older than the duty: `dataset build` says so where power and motion are separate files."""
_KT_NM_A, _R_OHM = 1.9, 3.4
_EPOCH_S, _APART_S, _STEP_S = 1.6e9, 20.0, 0.01


def runs(data: Path, mass: str) -> list[Path]:
    """Recordings with `mass` kg."""
    return sorted((data / f"mass_{mass}kg").glob("*.csv"))


def dataset(files: list[Path], out: Path, robot: Path = DESCRIPTION) -> Path:
    """The dataset of some recordings, each at a time of its own."""
    logs = out.with_name(f"{out.name}.logs")
    logs.mkdir(parents=True)
    for number, file in enumerate(files):
        _write_log(file, logs / file.name, _EPOCH_S + _APART_S * number)
    build(BuildConfig("log", logs, out, robot=str(robot), lag_s=_LAG_S), _quiet)
    return out


def _write_log(file: Path, to: Path, start_s: float) -> None:
    """A log with power; single positions that the servo cannot have reached are left out."""
    t, q, duty, voltage, _ = np.genfromtxt(file, delimiter=",", skip_header=1).T
    good = np.abs(q - medfilt(q, 5)) < 0.3
    t, q, volts = t[good], q[good], (duty * voltage)[good]
    grid = np.arange(t[0], t[-1], _STEP_S)
    speed = np.interp(t, grid, savgol_filter(np.interp(grid, t, q), 11, 2, deriv=1, delta=_STEP_S))
    P = volts * (volts - _KT_NM_A * speed) / _R_OHM
    np.savetxt(to, np.column_stack([t + start_s, q, P]), fmt="%.5f", delimiter=",", header="time,q1,power", comments="")


def judged(before: list[Path], after: list[Path], out: Path) -> Closed:
    """What the loop says of the recordings `after`, by a grey box of those `before`."""
    reference = dataset(before, out / "before")
    train_one(TrainConfig(reference, "grey-box", out / "model", robot=str(DESCRIPTION)), _quiet)
    return close_loop(CloseConfig(dataset(after, out / "after"), out / "model", out / "loop"), _quiet)


def _quiet(*_progress: object) -> None:
    """No progress."""


def _row(name: str, closed: Closed) -> list[str]:
    texts = []
    for effect in closed.improved.effects:
        moment = effect.term.parameters.get(MOMENT)
        sure = f"{effect.term.id} {percent(effect.confidence)}{'' if effect in closed.improved.named else ', no name'}"
        texts.append(
            sure
            if moment is None or moment["ci95"] is None
            else "{}: {:.4f} kg m ({:.4f} to {:.4f})".format(sure, moment["value"], *moment["ci95"])
        )
    return [name, closed.verdict, "; ".join(texts) or "-"]


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=DATA)
    given = parser.parse_args()
    light, heavy = runs(given.data, "0.535"), runs(given.data, "0.741")
    table = Table("recordings", "verdict", "effect, with its first moment", title="servo pendulum (derived power)")
    table.add_row(*_row(f"0.741 kg (true: {TRUE_KG_M} kg m more)", judged(light, heavy, given.out / "heavier")))
    for first, name in ((0, "even"), (1, "odd")):
        closed = judged(light[1 - first :: 2], light[first::2], given.out / name)
        table.add_row(*_row(f"0.535 kg, {name} runs by the others", closed))
    show(table, width=130)


if __name__ == "__main__":
    for_people(main)
