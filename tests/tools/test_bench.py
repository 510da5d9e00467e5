"""The bench runs: a section that is cheap, its table and its file of figures."""

from __future__ import annotations

import json

import pytest

from acqd.errors import OperationError


def test_the_cost_of_everything_live_is_printed_beside_the_peer(tmp_path, monkeypatch, capsys):
    pytest.importorskip("pqopen", reason="needs pqopen-lib")
    from tools.bench import __main__ as bench  # here, because its sections import torch
    from tools.bench import quality

    monkeypatch.setitem(bench._SECTIONS, "cost", [lambda: quality.cost(1)])
    bench.bench(only=["cost"], out=tmp_path / "bench.json")
    figures = {figure["name"]: figure for figure in json.loads((tmp_path / "bench.json").read_text())}
    assert all(figures[name]["value"] > 0 for name in ("rows", "events", "flicker", "all but pqopen-lib"))
    assert "targets missed" in capsys.readouterr().out


def test_sections_may_have_commas_between_them_and_another_name_is_one_line():
    from tools.bench.__main__ import chosen

    assert chosen(["cost,speed", "archive"]) == ["cost", "speed", "archive"]
    with pytest.raises(OperationError, match="--only spede: no such section; expected accuracy, quality"):
        chosen(["cost,spede"])
