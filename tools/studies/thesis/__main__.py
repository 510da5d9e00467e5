"""The thesis reproduced by one command, from its measurement campaign to its use case and the closed loop.

    python -m tools.studies.thesis OUT [--quick] [--seed 1] [--json]

Campaign -> dataset -> the 14 networks of Table 7.1 -> comparison -> FMU -> use case -> closed loop. Steps with results
are not repeated, so an interrupted run can be continued. OUT/report.html compares the results with the thesis. All
data are simulated. `--quick` runs everything on a tiny scale, to see that it works.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.table import Table

from acqd.cli.main import for_people
from acqd.errors import UserError
from tools.studies.thesis import plan
from tools.studies.thesis.assembly import GREY_BOX, Case, Places, evaluate
from tools.studies.thesis.claims import Results, claims
from tools.studies.thesis.pages import thesis_page, use_case_page
from tools.studies.thesis.steps import make_folder, run, seconds


def main() -> None:
    """Run all steps, write the report and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--quick", action="store_true", help="tiny campaign, few epochs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="the table as JSON on stdout")
    arguments = parser.parse_args()
    places, size = Places(arguments.out.resolve()), plan.QUICK if arguments.quick else plan.FULL
    make_folder(places.out)
    _require_same(places.out / "size.json", asdict(size) | {"seed": arguments.seed})
    steps = [
        *plan.training(places, size, arguments.seed),
        plan.table_7_1(places, size),
        plan.one_model(places, GREY_BOX, size),
        plan.compared(places),
        plan.exported(places, size),
        *plan.assembly(places, size, arguments.seed),
    ]
    run(steps, places.out, Console(stderr=True))
    case = Case.of(places)
    use_case = evaluate(case, places)
    use_case_page(use_case, case, places.out / "use-case.html")
    rows = claims(
        Results(
            places,
            manifest=json.loads((places.training / "manifest.json").read_text()),
            compared=json.loads((places.out / "compare.json").read_text()),
            fmu=json.loads((places.out / "fmu.json").read_text()),
            assembly=use_case,
        )
    )
    report = places.out / "report.html"
    thesis_page(rows, chapters(places), seconds(places.out), report, quick=arguments.quick)
    if arguments.json:
        print(json.dumps({"report": str(report), "claims": [asdict(row) for row in rows], "use_case": use_case}))
        return
    table = Table("thesis", "statement of the thesis", "reproduced", "agrees")
    for row in rows:
        table.add_row(row.figure, row.thesis, row.here, {True: "yes", False: "NO", None: ""}[row.agrees])
    console = Console()
    console.print(table)
    console.print(f"simulated data; report: {report}", highlight=False, soft_wrap=True)


def chapters(places: Places) -> list[tuple[str, Path]]:
    """Titles and reports of the steps, in the order of the thesis."""
    return [
        ("Chapter 5: excitation and the measured campaign", places.out / "training" / "report.html"),
        ("Chapter 6: data preparation", places.training / "report.html"),
        ("Chapter 8: models compared", places.models / "report.html"),
        ("Chapter 9: use case", places.out / "use-case.html"),
        ("Beyond the thesis: closing the loop", places.loop / "report.html"),
    ]


def _require_same(path: Path, size: dict[str, int]) -> None:
    """Raise UserError when the folder holds a reproduction of another size or seed."""
    if path.exists() and json.loads(path.read_text()) != size:
        raise UserError(f"{path.parent} holds a reproduction of another size or seed; name another folder")
    path.write_text(json.dumps(size))


if __name__ == "__main__":
    for_people(main)
