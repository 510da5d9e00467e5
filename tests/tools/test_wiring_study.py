"""The study of wirings counts what it should."""

from __future__ import annotations

import numpy as np

from tools.studies.wiring import __main__ as study


def test_wirings_are_named_and_healthy_sites_left_alone(monkeypatch):
    monkeypatch.setattr(study, "POWER_FACTORS", (0.3, 0.9))
    score = study.miswired(np.random.default_rng(5), 0.1, True, 1)
    assert (score.cases, score.wrong) == (48, 0) and score.right >= 47
    assert study.healthy(np.random.default_rng(6), 8, False).wrong == 0


def test_a_check_that_says_nothing_has_no_points(monkeypatch):
    monkeypatch.setattr(study, "POWER_FACTORS", (0.9,))
    monkeypatch.setattr(study, "examine", lambda *_: [])
    score = study.miswired(np.random.default_rng(5), 0.1, True, 1)
    assert (score.right, score.silent) == (1, 23)
