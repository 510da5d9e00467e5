"""One log's work."""

import shutil

import pytest

from acqd.sidecar import comparison
from acqd.sidecar.power_rows import PowerRowsMissingError
from acqd.sidecar.settings import Settings
from acqd.sidecar.worker import Worker
from acqd.storage.database import open_database
from tests.sidecar.cell import BEGIN, cell, motion, write_log


def test_power_that_comes_late_is_waited_for(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    engine = open_database(url)
    worker = Worker(Settings(bundle, url, None, None, 0.3), engine)
    q = motion(800, 0)
    write_log(logs / "a.csv", q, BEGIN)
    with pytest.raises(PowerRowsMissingError, match="no power rows up to"):
        worker.run(logs / "a.csv", "a.csv", "x")
    cell(logs, url, 1)
    assert worker.run(logs / "a.csv", "a.csv", "x").status == "ok"


def test_another_model_begins_the_drift_anew(tmp_path, bundle):
    engine = open_database(str(tmp_path / "p.sqlite"))
    first = Worker(Settings(bundle, "", None, None), engine)
    first.drift.monitor.sums[:] = 7.0
    other = tmp_path / "other"
    shutil.copytree(bundle, other)
    (other / "bundle.json").write_text((bundle / "bundle.json").read_text().replace('"trial"', '"trial 2"'))
    again, changed = (Worker(Settings(path, "", None, None), engine) for path in (bundle, other))
    again.restore(first.memory())
    changed.restore(first.memory())
    assert again.drift.monitor.sums.max() == 7.0 and changed.drift.monitor.sums.max() == 0.0
    again.restore({"model": first.memory()["model"], "lags": [[1]], "monitor": {}})  # of an earlier version


def test_a_log_is_merged_and_predicted_once(tmp_path, bundle, monkeypatch):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    engine = open_database(url)
    cell(logs, url, 1)
    worker = Worker(Settings(bundle, url, None, None, 0.3), engine)
    calls = []

    def counted(name, real):
        return lambda *arguments, **options: calls.append(name) or real(*arguments, **options)

    monkeypatch.setattr("acqd.sidecar.comparison.merge", counted("merge", comparison.merge))
    monkeypatch.setattr("acqd.sidecar.comparison.predictions", counted("predict", comparison.predictions))
    path = min(logs.iterdir())
    assert worker.run(path, path.name, "x").status == "ok"
    assert calls == ["merge", "predict"]
