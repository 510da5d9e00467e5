"""What a user would otherwise do with the same residual (simulated data): SINDy, FROLS, gradient boosting.

    python -m tools.studies.effects.rivals OUT [--base grey-box] [--cases NAME...]

OUT is a folder that `tools.studies.effects` has filled. Every method gets the residual of the same bundle on the same
recordings, the columns of acqd's own effects as its library (one shape each; what acqd finds by looking at the residual
has no column), the supply's lag and the meter's averaging included, and the same least power that counts. The effect
whose columns explain most is what the method names; below that least power it names nothing.

Needs acqd[rivals], in a separate environment (pyproject.toml says why).
"""

from __future__ import annotations

import argparse
import json
import os
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from tools.studies.effects.score import outcome, strength

Floats: TypeAlias = NDArray[np.float64]
_EVERY = 4  # rows: neighbours say the same
_LEAST_SHARE = 0.0025  # of the dynamic range, as acqd asks for
_WIDE = 0.6  # of the ensemble's models


@dataclass(frozen=True, slots=True)
class Task:
    """One dataset as the methods see it."""

    X: Floats
    """[rows, columns], each of unit RMS."""
    y: Floats
    """[rows] W."""
    owners: NDArray[np.str_]
    """[columns] the effect of each."""
    recordings: NDArray[np.int64]
    """[rows]."""
    least_W: float


def task_of(dataset: Path, bundle: Path) -> Task:
    """Residual and columns."""
    from acqd.models.bundle.restore import carrier_of, open_model
    from acqd.models.effects import library
    from acqd.models.effects.effect import effect_rows
    from acqd.models.effects.scene import scene_of
    from acqd.models.segments import load_dataset
    from acqd.residual.residuals import errors_of

    opened, model = open_model(bundle)
    carrier = carrier_of(opened, model)
    segments = load_dataset(dataset).segments
    X, y, recordings = [], [], []
    for number, (segment, errors) in enumerate(zip(segments, errors_of(model, segments), strict=True)):
        scene = scene_of(carrier, segment.q, segment.signals, segment.start_s, segment.channels)
        columns, owners = [], []
        for effect in library().values():
            if effect.possible(scene):
                own = effect_rows(effect, scene, effect.shapes[len(effect.shapes) // 2])
                columns.append(own[::_EVERY])
                owners += [effect.id] * own.shape[1]
        X.append(np.column_stack(columns))
        y.append(errors[::_EVERY])
        recordings.append(np.full(len(y[-1]), number))
    whole = np.concatenate(X)
    size = np.sqrt((whole**2).mean(axis=0))
    kept = size > 1e-9
    power = np.concatenate([segment.P for segment in segments])
    least = _LEAST_SHARE * float(np.ptp(np.percentile(power, [1, 99])))
    return Task(
        whole[:, kept] / size[kept], np.concatenate(y), np.array(owners)[kept], np.concatenate(recordings), least
    )


def _largest(task: Task, coefficients: Floats) -> str:
    """The effect whose columns together have most power."""
    powers = {
        owner: float(np.sqrt(((task.X[:, task.owners == owner] @ coefficients[task.owners == owner]) ** 2).mean()))
        for owner in np.unique(task.owners)
    }
    best = max(powers, key=lambda owner: powers[owner])
    return best if powers[best] > task.least_W else ""


def sindy(task: Task) -> str:
    """Ensemble SINDy (pysindy): STLSQ on bags of rows; columns that most models of the ensemble have."""
    import pysindy

    sparse = pysindy.STLSQ(threshold=task.least_W, alpha=0.01 * len(task.y))
    optimizer = pysindy.EnsembleOptimizer(sparse, bagging=True, n_models=20, n_subset=len(task.y) // 2)
    optimizer.fit(task.X, task.y[:, None])
    models = np.array([np.ravel(each) for each in optimizer.coef_list])
    wide = (models != 0).mean(axis=0) >= _WIDE
    return _largest(task, np.median(models, axis=0) * wide)


def frols(task: Task) -> str:
    """FROLS (SysIdentPy): forward orthogonal selection, its length by BIC; the first term's effect."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    model = FROLS(
        xlag=[[1]] * task.X.shape[1], ylag=1, order_selection=True, n_info_values=10, info_criteria="bic",
        estimator=LeastSquares(), basis_function=Polynomial(degree=1), model_type="NFIR",
    )  # fmt: skip
    X = np.vstack([task.X[1:], task.X[-1:]])  # its lags begin at one row
    model.fit(X=X, y=task.y[:, None])
    for code, explained in zip(model.final_model[:, 0], model.err, strict=False):
        column = int(code) // 1000 - 2
        if column >= 0:  # not the constant, nor the residual itself
            power = float(np.sqrt(explained * (task.y**2).mean()))
            return str(task.owners[column]) if power > task.least_W else ""
    return ""


def boosting(task: Task) -> str:
    """Gradient boosting (scikit-learn) on the columns; the effect whose shuffled columns cost most on held-out rows."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    held_out = task.recordings % 4 == 0
    model = HistGradientBoostingRegressor(max_iter=120, random_state=1)
    model.fit(task.X[~held_out], task.y[~held_out])
    X, y = task.X[held_out], task.y[held_out]
    error = float(((y - model.predict(X)) ** 2).mean())
    if float(y.var()) - error < task.least_W**2:
        return ""
    random, cost = np.random.default_rng(1), {}
    for owner in np.unique(task.owners):
        shuffled = X.copy()
        shuffled[:, task.owners == owner] = X[random.permutation(len(X))][:, task.owners == owner]
        cost[str(owner)] = float(((y - model.predict(shuffled)) ** 2).mean()) - error
    best = max(cost, key=lambda owner: cost[owner])
    return best if cost[best] > task.least_W**2 else ""


METHODS: dict[str, Callable[[Task], str]] = {"SINDy": sindy, "FROLS": frols, "boosting": boosting}


def run_case(bundle: Path, truth: Path, kept: Path) -> dict[str, tuple[str, float]]:
    """What each method names, and its seconds."""
    os.environ["OMP_NUM_THREADS"] = "1"
    if kept.exists():
        return dict(json.loads(kept.read_text()))
    warnings.simplefilter("ignore")
    task = task_of(Path(json.loads(truth.read_text())["dataset"]), bundle)
    found = {}
    for name, method in METHODS.items():
        begun = time.monotonic()
        found[name] = (method(task), time.monotonic() - begun)
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(found))
    return found


def main() -> None:
    """Run what is missing, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--base", default="grey-box")
    parser.add_argument("--cases", nargs="*", help="names or beginnings of names")
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    out = arguments.out.resolve()
    results = [json.loads(path.read_text()) for path in sorted((out / "results" / arguments.base).glob("*.json"))]
    if arguments.cases:
        results = [r for r in results if any(r["case"].startswith(name) for name in arguments.cases)]
    console = Console(width=120)
    rows: dict[tuple[str, str], list[tuple[str, float]]] = {}
    with ProcessPoolExecutor(arguments.jobs) as pool:
        work = {}
        for result in results:
            kept = out / "rivals" / arguments.base / f"{result['case']}.json"
            truth = out / "truth" / f"{result['case']}.json"
            run = partial(run_case, out / "models" / arguments.base, truth, kept)
            work[pool.submit(run)] = result
        for done in as_completed(work):
            result, found = work[done], done.result()
            level = strength(result)
            rows.setdefault((level, "acqd"), []).append((outcome(result), result["seconds"]))
            for name, (named, seconds) in found.items():
                judged = outcome(result | {"report": _as_report(named)})
                rows.setdefault((level, name), []).append((judged, seconds))
            named_all = ", ".join(f"{name} {value[0] or '-'}" for name, value in found.items())
            console.print(f"{result['case']}: {named_all}", highlight=False)
    table = Table("strength", "method", "cases", "outcomes", "seconds (median)", title="the same residuals (simulated)")
    for (level, name), cases in sorted(rows.items()):
        counts: dict[str, int] = {}
        for each, _ in cases:
            counts[each] = counts.get(each, 0) + 1
        outcomes = ", ".join(f"{count} {what}" for what, count in sorted(counts.items(), key=lambda x: -x[1]))
        table.add_row(level, name, str(len(cases)), outcomes, f"{np.median([taken for _, taken in cases]):.0f}")
    console.print(table)


def _as_report(named: str) -> dict[str, object]:
    effects = [{"id": named, "rivals": []}] if named else []
    return {"effects": effects, "verdict": "effects_found" if named else "nothing_left"}


if __name__ == "__main__":
    main()
