"""One log's work."""

import shutil

import numpy as np
import pytest
import sqlalchemy as sa

from acqd.sidecar import comparison
from acqd.sidecar.power_rows import PowerRowsMissingError
from acqd.sidecar.settings import Settings
from acqd.sidecar.worker import Worker
from acqd.storage.database import open_database
from tests.sidecar.cell import BEGIN, cell, motion, write_log


def run(worker, path):
    with path.open("rb") as file:
        return worker.run(path, file, path.name, "x")


def test_power_that_comes_late_is_waited_for(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    engine = open_database(url)
    worker = Worker(Settings(bundle, url, None, None, 0.3), engine)
    q = motion(800, 0)
    write_log(logs / "a.csv", q, BEGIN)
    with pytest.raises(PowerRowsMissingError, match="no power rows up to"):
        run(worker, logs / "a.csv")
    cell(logs, url, 1)
    assert run(worker, logs / "a.csv").status == "ok"


def test_a_database_that_does_not_answer_is_no_problem_of_the_log(tmp_path, bundle, monkeypatch):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    cell(logs, url, 1)
    engine = open_database(url)
    worker, (path,) = Worker(Settings(bundle, url, None, None, 0.3), engine), logs.iterdir()
    with monkeypatch.context() as away:
        away.setattr(engine, "connect", raising(sa.exc.OperationalError("", (), Exception("the server is away"))))
        with pytest.raises(sa.exc.OperationalError):
            run(worker, path)
        away.setattr(engine, "connect", raising(sa.exc.DataError("", (), Exception("out of range"))))
        assert "cannot be worked through" in run(worker, path).message["reason"], "no database takes this log's times"
    assert run(worker, path).status == "ok"


def raising(error):
    def fail():
        raise error

    return fail


def test_a_last_line_that_is_cut_off_is_left_out_and_said(tmp_path, bundle, caplog):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    engine = open_database(url)
    cell(logs, url, 1)
    (path,) = logs.iterdir()
    path.write_bytes(path.read_bytes()[:-30])
    assert run(Worker(Settings(bundle, url, None, None, 0.3), engine), path).status == "ok"
    assert "its last line is cut off" in caplog.text


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
    assert run(worker, path).status == "ok"
    assert calls == ["merge", "predict"]


def test_a_long_log_in_pieces_gives_what_it_gives_in_one(tmp_path, bundle, monkeypatch):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    engine = open_database(url)
    cell(logs, url, 1, rows=3000)
    path = min(logs.iterdir())
    whole = run(Worker(Settings(bundle, url, None, None, 0.3), engine), path)
    monkeypatch.setattr("acqd.robot.table_text._BLOCK_BYTES", 40_000)
    monkeypatch.setattr("acqd.sidecar.log_pieces._CELLS", 10_000)
    pieces = run(Worker(Settings(bundle, url, None, None, 0.3), engine), path)
    assert whole.status == pieces.status == "ok", pieces.message
    a, b = whole.message, pieces.message
    assert b["rows"] == pytest.approx(a["rows"], abs=4) and b["covered"] == pytest.approx(a["covered"], abs=0.002)
    assert b["lag_s"] == pytest.approx(a["lag_s"], abs=0.003)
    assert b["rmse_W"] == pytest.approx(a["rmse_W"], rel=0.02)
    times, P = np.asarray(pieces.filetime), dict(zip(whole.filetime, whole.P_predicted, strict=True))
    assert (np.diff(times) > 0).all()  # no row twice
    assert np.std([p - P[t] for t, p in zip(times, pieces.P_predicted, strict=True) if t in P]) < 0.3
