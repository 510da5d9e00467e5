"""How far the power of unchanged plants is wrong, and how much its sessions surprise a model (simulated plants).

    python -m tools.studies.foreign.noise OUT [--first 31] [--plants 4] [--harsh 2] [--json]

Of each plant, acqd trains a grey box and compares a clean campaign with the reference, as `acqd close-loop` does, up to
the noise model. `error` is the square root of s, the share by which the noise of a row rises with new power (ADR 100).
`surprise` is the mean square of z of any effect in one unchanged session; its mean over all sessions is the threshold
`usual_surprise`. The plants have six and seven axes in turn; nothing is judged on them.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.recordings import subject_of
from acqd.discrepancy.regression.setup import set_up
from acqd.discrepancy.search import comparison_of, unexplained
from acqd.discrepancy.selection.spread import surprises
from tools.common.tables import show
from tools.studies.foreign.cases import World, cases, make_after
from tools.studies.foreign.runner import Runner

_AXES, _CASE = (6, 7), "clean-1"


def noise_of(out: Path, world: World) -> dict[str, Any]:
    """Share by which the power of a plant is wrong, and the surprises of its sessions."""
    runner = Runner(out, world, "noise", None)
    bundle = runner.prepare()
    case = next(each for each in cases(world.axes, (3,)) if each.name == _CASE)
    make_after(world, case, runner.data / _CASE)
    dataset = runner.work / "datasets" / _CASE
    if not dataset.exists():
        runner.build(runner.data / _CASE, dataset)
    subject = subject_of(CloseConfig(dataset, bundle, dataset.with_name("unused")), lambda *_: None)
    _, subject = unexplained(subject)
    setup = set_up(comparison_of(subject), lambda _: None)
    rising = setup.design.columns.rising
    return {
        "plant": world.name, "error": float(np.sqrt(rising)), "surprises": surprises(setup.design, setup.regression),
    }  # fmt: skip


def main() -> None:
    """Print a line for each plant, and the mean surprise."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument("--first", type=int, default=31, help="seed of the first plant")
    parser.add_argument("--plants", type=int, default=4, help="ordinary ones")
    parser.add_argument("--harsh", type=int, default=2, help="plants at harsh sites with clocks, after these")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    worlds = [
        World(_AXES[k % 2], given.first + k, "short", False, k >= given.plants, k >= given.plants)
        for k in range(given.plants + given.harsh)
    ]
    rows = [noise_of(given.out.resolve(), world) for world in track(worlds, "plants", console=Console(stderr=True))]
    every = [surprise for row in rows for surprise in row["surprises"]]
    if given.json:
        print(json.dumps({"plants": rows, "mean_surprise": float(np.mean(every))}))
        return
    table = Table("plant (simulated)", "error", "surprise of each session")
    for row in rows:
        shown = ", ".join(f"{surprise:.2f}" for surprise in row["surprises"])
        table.add_row(row["plant"], f"{100 * row['error']:.1f} %", shown)
    show(table, width=100)
    print(f"mean surprise of {len(every)} sessions: {np.mean(every):.2f}")


if __name__ == "__main__":
    main()
