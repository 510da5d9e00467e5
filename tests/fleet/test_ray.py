"""Fleets and trainings on Ray: the same results as in processes."""

import json

import pytest

from acqd.models.bundle.bundle import load_bundle
from tests.commands import acqd, acqd_here, without_workers

pytestmark = pytest.mark.minutes


def test_a_fleet_on_ray_finds_what_it_finds_in_processes(closed, tmp_path):
    pytest.importorskip("ray")
    folder, _ = closed
    (tmp_path / "plant.toml").write_text(
        "[fleet]\nonly = ['payload', 'offset_shift']\nmax_effects = 1\n"
        f"[defaults]\nmodel = '{folder / 'model'}'\n[robots.now]\ndataset = '{folder / 'now' / 'ds'}'\n"
        f"[robots.before]\ndataset = '{folder / 'before' / 'ds'}'\n[robots.none]\ndataset = 'nowhere'\n"
    )
    words = ("fleet", tmp_path / "plant.toml", "--json")
    done = acqd(*words, "--engine", "ray", "--out", tmp_path / "ray")
    assert done.returncode == 1, done.stderr
    with without_workers():
        here = acqd_here(*words, "--out", tmp_path / "here")
    robots = [json.loads(printed)["robots"] for printed in (done.stdout, here.stdout)]
    for robot in (robot for report in robots for robot in report):
        robot.pop("report")
    assert robots[0] == robots[1]
    assert [robot["state"] for robot in robots[0]] == ["changed", "unchanged", "failed"]


def test_networks_trained_on_ray_are_those_trained_in_processes(closed, tmp_path):
    pytest.importorskip("ray")
    ds = closed[0] / "before" / "ds"
    words = ("train", ds, "--network", "7x1dim", "--seed", 1, "--seed", 2, "--epochs", 2, "--json", "--models")
    done = acqd(*words, tmp_path / "ray", "--engine", "ray")
    assert done.returncode == 0, done.stderr
    assert [entry["training"]["seed"] for entry in json.loads(done.stdout)] == [1, 2]
    with without_workers():
        assert acqd_here(*words, tmp_path / "here").returncode == 0
    for name in ("7x1dim-everything-s1", "7x1dim-everything-s2"):
        theta, other = (load_bundle(tmp_path / place / name).arrays["theta"] for place in ("ray", "here"))
        assert theta == pytest.approx(other, abs=1e-6)
