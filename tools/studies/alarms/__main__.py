"""How soon `acqd close-loop --watch` raises its alarm, and how often it cries wolf (simulated data).

    python -m tools.studies.alarms OUT [--base grey-box] [--hours 200] [--make SEED [--clean 8] [--jobs 2]]

OUT is a folder that `tools.studies.effects` has filled: datasets with an effect from their first row on, and clean
ones. `--make` fills a folder with a plant, every effect at 3 % of the dynamic range, and clean campaigns of 27 minutes.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from acqd.models.bundle.restore import open_model
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment, load_dataset
from acqd.monitor.baseline import baseline_of
from acqd.monitor.cusum import Alarm, Baseline, Monitor
from acqd.residual.residuals import errors_of
from tools.studies.effects.cases import Case, World, make_case
from tools.studies.effects.prepared import known_for, prepared

_STRENGTH = 0.03


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--base", default="grey-box")
    parser.add_argument("--hours", type=float, default=200.0, help="recorded time that one false alarm may come in")
    parser.add_argument("--make", type=int, metavar="SEED", help="of the plant; the loop is not closed")
    parser.add_argument("--clean", type=int, default=8, help="clean campaigns of 27 minutes to make")
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    if arguments.make is not None:
        world = World.of("iiwa7_r800", arguments.make, arguments.out.resolve(), arguments.clean)
        make(world, arguments.base, arguments.jobs)
    bundle = arguments.out / "models" / arguments.base
    _, model = open_model(bundle)
    baseline = baseline_of(bundle, model, 3600 * arguments.hours)
    wolf, hours = 0, 0.0
    found: dict[str, list[tuple[str, Alarm | None, float, float]]] = {}
    for truth in sorted((arguments.out / "truth").glob("*.json")):
        case = json.loads(truth.read_text())
        segments = sorted(load_dataset(Path(case["dataset"])).segments, key=lambda each: each.start_s)
        if not case["effects"]:
            wolf += false_alarms(model, baseline, segments)
            hours += sum(len(each.P) for each in segments) * model.step_s / 3600
            continue
        strength = "pair" if len(case["effects"]) > 1 else f"{case['effects'][0]['strength']:g}"
        alarm, minutes = first_alarm(model, baseline, segments)
        off = 0.0 if alarm is None else (alarm.onset_s - segments[0].start_s) / 60
        found.setdefault(strength, []).append((truth.stem, alarm, minutes, off))
    title = f"sequential test (simulated); clean: {wolf} false alarms in {hours:.1f} h"
    table = Table("strength", "cases", "alarm", "within 10 min", "recorded minutes to it (median, 90 %)",
                  "onset told late by, min (median)", title=title)  # fmt: skip
    for strength, cases in sorted(found.items()):
        taken = [each[2] for each in cases if each[1] is not None]
        late = [each[3] for each in cases if each[1] is not None]
        table.add_row(
            strength, str(len(cases)), str(len(taken)), str(sum(m <= 10 for m in taken)),
            f"{np.median(taken):.1f}, {np.percentile(taken, 90):.1f}" if taken else "-",
            f"{np.median(late):.1f}" if late else "-",
        )  # fmt: skip
    console = Console(width=140)
    console.print(table)
    for name, alarm, minutes, _ in (each for strength in sorted(found) for each in found[strength]):
        if alarm is not None:
            joint = "" if alarm.joint is None else f", joint {alarm.joint}"
            console.print(f"{name}: {alarm.chart}{joint}, {minutes:.1f} min", highlight=False)
    silent = [f"{each[0]}" for cases in found.values() for each in cases if each[1] is None]
    console.print(f"no alarm within the dataset: {', '.join(silent)}")


def make(world: World, base: str, jobs: int) -> None:
    """Fill the world's folder."""
    prepared(world, base, epochs=1000)
    cases = [Case(f"{effect}-{_STRENGTH:g}", 1, ((effect, _STRENGTH),)) for effect in known_for(world)]
    cases += [Case(f"clean{test}", test, ()) for test in range(1, world.tests + 1)]
    with ProcessPoolExecutor(jobs) as pool:
        for _ in track(pool.map(partial(make_case, world), cases), "datasets", len(cases)):
            pass


def first_alarm(model: Predictor, baseline: Baseline, segments: list[Segment]) -> tuple[Alarm | None, float]:
    """And the recorded minutes before it."""
    monitor, minutes = Monitor(baseline), 0.0
    for segment, errors, guess in zip(segments, errors_of(model, segments), predictions(model, segments), strict=True):
        alarm = monitor.update(errors, guess, segment.start_s, model.step_s, segment)
        if alarm is not None:
            return alarm, minutes + (alarm.raised_s - segment.start_s) / 60
        minutes += len(segment.P) * model.step_s / 60
    return None, minutes


def false_alarms(model: Predictor, baseline: Baseline, segments: list[Segment]) -> int:
    """In recordings without an effect; after an alarm the charts start again at zero."""
    monitor, count = Monitor(baseline), 0
    for segment, errors, guess in zip(segments, errors_of(model, segments), predictions(model, segments), strict=True):
        if monitor.update(errors, guess, segment.start_s, model.step_s, segment) is not None:
            monitor, count = Monitor(baseline), count + 1
    return count


if __name__ == "__main__":
    main()
