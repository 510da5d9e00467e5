"""One log's work."""

import shutil

import pytest

from acqd.dataset.align import Lag
from acqd.sidecar.work import NoPowerYetError, Settings, Worker
from acqd.storage.database import open_database
from tests.sidecar.cell import BEGIN, cell, motion, write_log


def test_power_that_comes_late_is_waited_for(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    engine = open_database(url)
    worker = Worker(Settings(bundle, url, None, None, 0.3), engine)
    q = motion(800, 0)
    write_log(logs / "a.csv", q, BEGIN)
    with pytest.raises(NoPowerYetError, match="no power rows up to"):
        worker.run(logs / "a.csv", "a.csv", "x")
    cell(logs, url, 1)
    assert worker.run(logs / "a.csv", "a.csv", "x").status == "ok"


def test_the_clocks_line_holds_for_more_logs_than_it_remembers_and_begins_anew_when_it_was_set(tmp_path, bundle):
    worker = Worker(Settings(bundle, "", None, None), open_database(str(tmp_path / "p.sqlite")))
    located = []
    worker._later = lambda *_: 0.0  # the model's refinement is another test's
    for number in range(45):
        middle = 3600.0 * number
        lag = 1.0 + 20e-6 * middle + (2.0 if number >= 38 else 0.0)
        seconds, how = worker.placed(middle, Lag(lag, 0.9, 3.0))
        located.append((seconds - lag, how))
    assert max(abs(off) for off, _ in located) < 1e-3
    assert located[37][1] == "clock line" and located[38][1] == "own" and located[-1][1] == "clock line"


def test_another_model_begins_the_drift_anew(tmp_path, bundle):
    engine = open_database(str(tmp_path / "p.sqlite"))
    first = Worker(Settings(bundle, "", None, None), engine)
    first.monitor.sums[:] = 7.0
    other = tmp_path / "other"
    shutil.copytree(bundle, other)
    (other / "bundle.json").write_text((bundle / "bundle.json").read_text().replace('"trial"', '"trial 2"'))
    again, changed = (Worker(Settings(path, "", None, None), engine) for path in (bundle, other))
    again.restore(first.memory())
    changed.restore(first.memory())
    assert again.monitor.sums.max() == 7.0 and changed.monitor.sums.max() == 0.0
    again.restore({"model": first.memory()["model"], "lags": [[1]], "monitor": {}})  # of an earlier version
