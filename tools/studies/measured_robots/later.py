"""A real arm with an undeclared change: what `acqd close-loop` says of two later sessions of the UR10e.

    python -m tools.studies.measured_robots.later OUT [--data ../shared/data/robots] [--unchanged N]

The reference is the folder `ur10e`. The sessions of `ur10e_later` are judged alone and together, cut into pieces of 5
and of 10 s, dated one day and 150 days after the reference, from power only and with motor currents. `--unchanged N`
also leaves N sessions of the reference out, one at a time, and judges each against the others: nothing mechanical has
changed there. The power is derived from measured currents.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from acqd.cli.main import for_people
from acqd.models.effects import library
from acqd.report.digits import percent
from tools.studies.measured_robots.__main__ import acqd, write_inputs

_ROBOT = "ur10e"
_EPOCH_S = 1_700_000_000.0
_DAY_S = 86_400.0
_REFERENCE_CUT_S = 15.0
_SHORTEST_BYTES = 500_000  # a session of about half a minute


@dataclass(frozen=True)
class Case:
    """A variation."""

    name: str
    paths: tuple[Path, ...]
    cut_s: float
    days: float
    currents: bool

    @property
    def folder(self) -> str:
        """Name of the case's folder."""
        return f"{self.name}-{self.cut_s:g}s-{self.days:g}d-{'currents' if self.currents else 'power'}"


def variations(later: Path) -> Iterator[Case]:
    """Twelve: three choices of sessions, two lengths of pieces, with and without currents; two dates in turn."""
    a, b = later / "session_a.csv", later / "session_b.csv"
    for name, paths in (("a", (a,)), ("b", (b,)), ("both", (a, b))):
        for cut_s, days in ((5.0, 150.0), (10.0, 1.0)):
            for currents in (False, True):
                yield Case(name, paths, cut_s, days, currents)


def build(paths: list[Path], out: Path, cut_s: float, *, currents: bool, epoch_s: float) -> Path:
    """The dataset of some recordings, made once."""
    ds = out / "ds"
    if not ds.exists():
        write_inputs(_ROBOT, paths, out, currents=currents, epoch_s=epoch_s)
        acqd(
            "dataset", "build", "--power", f"{out}/power.csv", "--logs", f"{out}/logs", "--robot", _ROBOT,
            "--lag", "0", "--cut", str(cut_s), "--out", str(ds),
        )  # fmt: skip
    return ds


def reference(paths: list[Path], out: Path, *, currents: bool) -> tuple[Path, Path]:
    """Dataset and grey box of the reference."""
    ds = build(paths, out, _REFERENCE_CUT_S, currents=currents, epoch_s=_EPOCH_S)
    model = out / "model"
    if not model.exists():
        acqd("train", str(ds), "--network", "grey-box", "--out", str(model))
    return ds, model


def judge(ds: Path, before: tuple[Path, Path], out: Path) -> dict[str, Any]:
    """report.json, or the message of a refusal."""
    command = [
        *(sys.executable, "-m", "acqd", "close-loop", str(ds), "--reference", str(before[0])),
        *("--model", str(before[1]), "--out", str(out / "loop"), "--json"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return {"verdict": (done.stderr.strip().splitlines() or ["no message"])[-1], "effects": []}
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def named(report: dict[str, Any]) -> str:
    """Effects with their first parameter."""
    texts = []
    for effect in report["effects"]:
        name, first = next(iter(effect["parameters"].items()))
        interval = "" if first["ci95"] is None else " ({:.3g} to {:.3g})".format(*first["ci95"])
        texts.append(
            f"{effect['id']} ({effect['where']}): {name} {first['value']:.3g} {first['unit']}{interval}, "
            f"{percent(effect['confidence'])}"
        )
    return "; ".join(texts)


def row(name: str, report: dict[str, Any]) -> list[str]:
    """A row of the table."""
    errors = ["", "", ""]
    if "before" in report:
        values = (report["before"]["rmse"], report["after"]["rmse"], report["reference_rmse"])
        errors = [f"{value:.2f}" for value in values]
    return [name, report["verdict"], named(report), *errors]


def mechanical(report: dict[str, Any]) -> bool:
    """Whether the report claims an effect that acts as a torque."""
    return any(library()[effect["id"]].acts_on == "torque" for effect in report["effects"] if effect["added"])


def main() -> None:
    """Print one table for the changed sessions, and one for the unchanged ones."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[4] / "shared" / "data" / "robots")
    parser.add_argument("--unchanged", type=int, default=0, help="sessions of the reference to leave out in turn")
    arguments = parser.parse_args()
    out, paths = arguments.out, sorted((arguments.data / _ROBOT).glob("*.csv"))
    head = ("session", "verdict", "named", "RMSE before [W]", "after", "reference")
    table = Table(*head, title="UR10e, later sessions (power derived from measured currents)")
    before = {kind: reference(paths, out / f"reference-{kind}", currents=kind) for kind in (False, True)}
    for case in variations(arguments.data / "ur10e_later"):
        folder = out / case.folder
        epoch_s = _EPOCH_S + case.days * _DAY_S
        ds = build(list(case.paths), folder, case.cut_s, currents=case.currents, epoch_s=epoch_s)
        table.add_row(*row(case.folder, judge(ds, before[case.currents], folder)))
    console = Console(width=170)
    console.print(table)
    long = [path for path in paths if path.stat().st_size > _SHORTEST_BYTES][-arguments.unchanged :]
    if not arguments.unchanged:
        return
    table = Table(*head, "mechanical claim", title="UR10e, unchanged sessions, each against all others")
    for path in long:
        folder = out / f"unchanged-{path.stem}"
        others = reference([other for other in paths if other != path], folder / "reference", currents=True)
        ds = build([path], folder, 10.0, currents=True, epoch_s=_EPOCH_S + _DAY_S)
        report = judge(ds, others, folder)
        table.add_row(*row(path.stem, report), "yes" if mechanical(report) else "no")
    console.print(table)


if __name__ == "__main__":
    for_people(main)
