"""The thesis' use case (chapter 9) in the virtual laboratory: an assembly measured, predicted and simulated.

    python -m tools.studies.use_case OUT [--limited 46 --all 30 --assemblies 24 --epochs 2000 --seed 1]

Trains on random motions, measures assemblies with undeclared effects, predicts their power from measured angles and
from the twin's, closes the loop, and writes OUT/report.html and OUT/report.json. All data are simulated.
A step whose results exist is not repeated.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from rich.console import Console

from acqd.cli.main import for_people
from tools.studies.thesis import plan
from tools.studies.thesis.assembly import GREY_BOX, NETWORK, Case, Places, evaluate
from tools.studies.thesis.pages import loop_text, table, use_case_page
from tools.studies.thesis.steps import make_folder, run


def main() -> None:
    """Run all steps, write the report and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--limited", type=int, default=46)
    parser.add_argument("--all", type=int, default=30)
    parser.add_argument("--assemblies", type=int, default=24)
    parser.add_argument("--epochs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    places = Places(arguments.out.resolve())
    make_folder(places.out)
    size = plan.Size(arguments.limited, arguments.all, arguments.assemblies, arguments.epochs, 0)
    steps = [
        *plan.training(places, size, arguments.seed),
        *(plan.one_model(places, network, size) for network in (GREY_BOX, NETWORK)),
        *plan.assembly(places, size, arguments.seed),
    ]
    run(steps, places.out, Console(stderr=True))
    case = Case.of(places)
    results = evaluate(case, places)
    use_case_page(results, case, places.out / "report.html")
    (places.out / "report.json").write_text(json.dumps(results, indent=1))
    console = Console(width=150)
    for row in table(results):
        console.print(*(f"{cell:.2f}" if isinstance(cell, float) else f"{cell:22}" for cell in row), highlight=False)
    console.print(f"loop: {loop_text(results)}", highlight=False)


if __name__ == "__main__":
    for_people(main)
