"""Stages of a study that are computed once, and the table of verdicts that change."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acqd.arrays import Floats
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import close_loop
from acqd.discrepancy.regression.least_squares import Column
from acqd.discrepancy.thresholds import THRESHOLDS, Thresholds
from tools.studies.foreign.cases import Case, World, make_after
from tools.studies.foreign.once import Once, once
from tools.studies.foreign.robustness import QUANTITIES, moved, table_of
from tools.studies.foreign.runner import Runner


def test_equal_values_are_computed_once_and_others_again() -> None:
    calls = []

    def count(columns: list[Column], rows: Floats) -> list[float]:
        calls.append(columns)
        return [float(rows.sum())]

    once = Once().stage(count, lambda *arguments: arguments)
    gate = np.ones(3)
    assert once([Column(1, gate, 2.0)], np.arange(3.0)) == [3.0]
    assert once([Column(1, gate.copy(), 2.0)], np.arange(3.0)) == [3.0]
    assert len(calls) == 1
    once([Column(1, gate, 2.5)], np.arange(3.0))
    once([Column(1, gate, 2.0)], np.arange(3.0, dtype=np.float32))
    once([Column(1, gate, 2.0), Column(2, gate, 2.0)], np.arange(3.0))
    assert len(calls) == 4


def test_who_asked_may_add_to_a_list() -> None:
    once = Once().stage(lambda number: [number], lambda number: number)
    once(1).append(2)
    assert once(1) == [1]


@pytest.mark.parametrize("quantity", QUANTITIES.values())
def test_a_stage_runs_again_where_a_threshold_that_it_reads_has_moved(quantity: str) -> None:
    """Also where an inner stage reads the threshold, the second time from its known result."""
    once, calls = Once(), []
    inner = once.stage(lambda: getattr(THRESHOLDS, quantity), lambda: ())

    def doubled(number: int) -> float:
        calls.append(number)
        return number * float(inner())

    outer = once.stage(doubled, lambda number: number)
    with once.watched():
        usual = [outer(1), outer(2), outer(1)]
        assert calls == [1, 2]
        with moved(quantity, 0.7):
            other, value = [outer(1), outer(2)], float(getattr(THRESHOLDS, quantity))
        assert other == [value, 2 * value] and other != usual[:2]
        assert [outer(1), outer(2), outer(1)] == usual
        calls.clear()
        with moved(next(name for name in QUANTITIES.values() if name != quantity), 0.7):
            assert outer(1) == usual[0] and not calls
    assert "__getattribute__" not in vars(Thresholds)


@pytest.mark.slow("discrepancy")
def test_stages_computed_once_change_nothing_that_a_case_shows(tmp_path: Path) -> None:
    """A pump that has a name only if unchanged sessions are taken to differ by less, beside the usual verdict."""
    case, runner = (
        Case("lagging_pump-3", ("lagging_pump",), 3),
        Runner(tmp_path, World(6, 2411, "brief", False, False), "base", None),
    )
    make_after(runner.world, case, runner.data / case.name)
    bundle, dataset = runner.prepare(), tmp_path / "ds"
    runner.build(runner.data / case.name, dataset)

    def shown() -> Any:
        closed = close_loop(CloseConfig(dataset, bundle, tmp_path / "unused"), lambda *_: None)
        tables = [[(row.name, row.finding.evidence, row.missing) for row in t] for t in closed.selection.tables]
        effects = [(each.term.id, each.status, each.confidence, each.missing) for each in closed.improved.effects]
        return closed.verdict, tables, effects, closed.before, closed.after, closed.reference_rmse

    def all_shown() -> list[Any]:
        found = [shown()]
        for name in ("usual_difference", "column_error"):
            with moved(name, 1.3):
                found.append(shown())
        return [*found, shown()]

    computed_every_time = all_shown()
    with once():
        assert all_shown() == computed_every_time
    usual, tau, kappa, again = computed_every_time
    assert usual == again and usual != tau and usual != kappa


def test_a_case_that_any_quantity_changes_counts_once() -> None:
    changed = {"kappa x 0.7": ["nothing_left"], "tau x 1.3": ["nothing_left"]}
    table = table_of([{"changes": changed}, {"changes": {}}])
    quantity, factor, changes, _ = table.columns
    shares = dict(zip(zip(quantity.cells, factor.cells, strict=True), changes.cells, strict=True))
    assert shares["kappa", "0.7"] == "1 of 2"
    assert shares["kappa", "1.3"] == "0 of 2"
    assert shares["any", "both"] == "1 of 2"
