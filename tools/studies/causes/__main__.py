"""How often the set of causes holds the cause, on foreign plants that its calibration has not seen (simulated).

    python -m tools.studies.causes OUT [OUT ...] [--label base] [--json]
    python -m tools.studies.causes OUT --calibrate acqd/discrepancy/causes/calibration.json [--nothing-only]

OUT are folders of the foreign study (`python -m tools.studies.foreign OUT`). Two tables: with the calibration that
acqd ships, and, for every plant, with one that was fitted to the other plants. `--calibrate FILE` fits
to all cases in OUT and writes the file; with `--nothing-only`, what tells hypotheses from each other stays as shipped.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from itertools import compress
from pathlib import Path

import orjson
from rich.table import Table

from acqd.discrepancy.causes.belief import Belief, Calibration, shipped
from tools.common.tables import show
from tools.studies.causes.fit import calibrated, figures, left_out, reliability
from tools.studies.causes.standings import Row, read

_WIDTH = 150
_SHOWN = {
    "cases": "cases", "coverage": "set holds", "coverage_known": "known", "coverage_unknown": "outside",
    "coverage_nothing": "nothing", "size": "mean size", "detected": "detected", "false_alarms": "false alarms",
    "probability_known": "p of known", "probability_unknown": "p of outside",
}  # fmt: skip


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, nargs="+", metavar="OUT")
    parser.add_argument("--label", default="base", help="folder of the results (default base)")
    parser.add_argument("--calibrate", type=Path, metavar="FILE", help="fit to all cases and write FILE")
    parser.add_argument("--nothing-only", action="store_true", help="fit only whether anything has changed")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    rows = [row for out in given.out for row in read(out, given.label)]
    if not rows:
        sys.exit(f"{given.out[0]} has no results of label {given.label}: python -m tools.studies.foreign OUT")
    kept = shipped() if given.nothing_only else None
    if given.calibrate:
        source = _source(rows)
        calibration = calibrated(rows, f"{_first_fit(kept)}; nothing: {source}" if kept else source, kept)
        given.calibrate.write_bytes(orjson.dumps(calibration.as_json(), option=orjson.OPT_INDENT_2) + b"\n")
    beliefs = {
        "as reported": [row.said for row in rows],
        "calibrated on other plants": left_out(rows, kept) if len({row.world for row in rows}) > 1 else [],
    }
    found = {name: _by_group(rows, each) for name, each in beliefs.items() if each}
    sure = {name: reliability(rows, each) for name, each in beliefs.items() if each}
    if given.json:
        print(json.dumps({"figures": found, "reliability": sure}))
        return
    for name, groups in found.items():
        table = Table("cases", *_SHOWN.values(), title=f"sets of causes, {name} (simulated)")
        for group, values in groups.items():
            table.add_row(group, *(_cell(key, values[key]) for key in _SHOWN))
        show(table, width=_WIDTH)
        table = Table("probability of the likeliest from", "cases", "said %", "right %")
        for each in sure[name]:
            table.add_row(f"{each['from']:.2f}", f"{each['cases']:.0f}", f"{100 * each['said']:.0f}",
                          f"{100 * each['right']:.0f}")  # fmt: skip
        show(table, width=_WIDTH)


def _by_group(rows: Sequence[Row], beliefs: Sequence[Belief]) -> dict[str, dict[str, float]]:
    """Figures of all cases, of every family of plants, and of every strength."""
    groups: dict[str, list[bool]] = {"all": [True] * len(rows)}
    for family in sorted({row.family for row in rows}):
        groups[family] = [row.family == family for row in rows]
    for strength in sorted({row.strength for row in rows} - {0}, reverse=True):
        groups[f"{strength} %"] = [row.strength == strength for row in rows]
    found = {}
    for name, belongs in groups.items():
        chosen = list(compress(zip(rows, beliefs, strict=True), belongs))
        found[name] = figures([row for row, _ in chosen], [belief for _, belief in chosen])
    return found


def _cell(key: str, value: float) -> str:
    if value != value:
        return "-"
    return f"{value:.0f}" if key == "cases" else f"{value:.2f}" if key == "size" else f"{100 * value:.0f} %"


def _first_fit(kept: Calibration) -> str:
    return kept.source.partition("; nothing: ")[0]


def _source(rows: Sequence[Row]) -> str:
    worlds = sorted({row.world for row in rows})
    return f"{len(rows)} simulated cases of the foreign study ({', '.join(worlds)})"


if __name__ == "__main__":
    main()
