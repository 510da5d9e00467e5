"""What the page of a comparison says first."""

from types import SimpleNamespace
from typing import Any

import pytest

from acqd.models.compare.evaluate import Comparison
from acqd.models.compare.report import _verdict


def entry(name, mae):
    metrics = {"everything": SimpleNamespace(mae=mae, recordings=9, energy_p95=0.05)}
    return SimpleNamespace(name=name, metrics=metrics, mae_ci95=(mae, mae), trained_on="everything")


@pytest.mark.parametrize(
    ("baseline", "says", "tone"),
    [(0.281, "No model predicts better than linear physics: 0.281 W, grey-box 0.282 W", "open"),
     (0.5, "grey-box predicts the power best: 0.282 W", "found")],
)  # fmt: skip
def test_a_model_that_a_baseline_beats_is_not_called_the_best(baseline, says, tone):
    models: Any = [entry("grey-box", 0.282)]
    baselines: Any = [entry("constant", 0.55), entry("linear physics", baseline)]
    verdict = _verdict(Comparison(None, [], models, baselines, 0.16, "between neighbouring rows", []))  # type: ignore[arg-type]
    assert verdict.headline.startswith(says) and verdict.tone == tone
