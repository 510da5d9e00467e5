"""A folder as the examples of the documentation have it."""

import shutil

import pytest


@pytest.fixture
def folder(closed, tmp_path, monkeypatch):
    """The working folder: ds, now, model, logs and power.csv, all simulated."""
    made = closed[0]
    for source, name in (("before/ds", "ds"), ("now/ds", "now"), ("model", "model"), ("now/logs", "logs")):
        shutil.copytree(made / source, tmp_path / name)
    shutil.copy(made / "now" / "power.csv", tmp_path)
    log = sorted((tmp_path / "logs").iterdir())[0]
    log.rename(log.with_name("example.csv"))
    monkeypatch.chdir(tmp_path)
    return tmp_path
