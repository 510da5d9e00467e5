"""The prior that robots of a type teach: its estimate, its file, and what it is worth to a new robot."""

import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.fleet.config import read_fleet
from acqd.fleet.empirical_bayes import Evidence, learned
from acqd.fleet.prior import FEWEST, prior_for, priors_of
from acqd.models.bundle.bundle import save_bundle
from acqd.models.greybox.fit import fit_grey_box
from acqd.models.greybox.fleet_prior import FleetPrior
from acqd.models.greybox.gain_basis import compared, powers
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import prior, table
from acqd.models.metrics import predictions
from acqd.robot.arm import Arm
from acqd.robot.dynamics import inertial_parameters
from tests.builders import ROBOT, STEP, grey_bundle, recording
from tests.commands import acqd_here, refused


def fleet_of(folder, model, count, spread=0.05):
    """A fleet's file with bundles whose parameters scatter about those of `model`."""
    random = np.random.default_rng(1)
    lines = ["[defaults]", "model = '{name}'", "dataset = 'ds'"]
    for k in range(count):
        values = model.values * random.normal(1, spread, len(model.values))
        entries = table(model.layout, values, np.diag((0.01 * values) ** 2))
        save_bundle(folder / f"r{k}", grey_bundle(parameters=entries))
        lines.append(f"[robots.r{k}]")
    (folder / "plant.toml").write_text("\n".join(lines))
    return read_fleet(folder / "plant.toml")


def robots_of(count, spread, seed, size=6, directions=3):
    """True parameters [count, size] and the evidence of each robot: few directions, other ones for each robot."""
    random = np.random.default_rng(seed)
    centre = random.normal(size=size)
    truth = centre + spread * random.normal(size=(count, size))
    evidence = []
    for own in truth:
        J = 10 * random.normal(size=(directions, size))
        seen = J @ own + random.normal(size=directions)
        evidence.append(Evidence(J.T @ J, J.T @ seen))
    return centre, truth, evidence


def test_robots_know_together_what_none_of_them_knows_alone():
    spread = np.array([0.0, 0.0, 0.0, 0.3, 0.3, 0.3])
    centre, _, evidence = robots_of(30, spread, seed=1)
    found = learned(evidence, np.zeros(6), np.full(6, 3.0), "aaabbb")
    assert np.abs(found.mean - centre).max() < 0.2  # three observations of six parameters say nothing alone
    assert found.spread[3:] == pytest.approx(0.3, abs=0.12)
    assert found.spread[:3].max() < 0.1  # errors of the fits are no spread between robots


@pytest.mark.parametrize(("directions", "most"), [(6, 1.3), (3, 2.0)])
def test_a_further_robot_lies_within_the_predictive_distribution(directions, most):
    squares = []
    for seed in range(100):
        _, truth, evidence = robots_of(9, 0.5, seed, directions=directions)
        found = learned(evidence[:8], np.zeros(6), np.full(6, 3.0), "aaabbb")
        away = truth[8] - found.mean
        squares.append(away @ np.linalg.solve(found.predictive(), away) / 6)
    assert 0.6 < np.median(squares) < 1.2
    assert np.mean(squares) < most  # variances of eight robots vanish sometimes


def test_what_nobody_saw_keeps_the_descriptions_prior():
    _, _, evidence = robots_of(8, 0.1, seed=2)
    blind = [Evidence(np.pad(one.information, (0, 1)), np.append(one.shift, 0.0)) for one in evidence]
    found = learned(blind, np.arange(7.0), np.full(7, 3.0), "aaabbbc")
    assert found.mean[6] == pytest.approx(6.0)
    assert np.sqrt(found.predictive()[6, 6]) == pytest.approx(3.0, rel=0.05)


def test_the_file_of_a_prior_is_read_as_it_was_written_and_damage_is_named(model, tmp_path):
    found = priors_of(fleet_of(tmp_path, model, 6))["ur10e"]
    found.write(tmp_path / "p.json")
    again = FleetPrior.read(tmp_path / "p.json")
    assert again.names == found.names and again.covariance == pytest.approx(found.covariance)
    for text in ("{", "{}", '{"format": 2}', '{"format": 1, "names": ["a"], "mean": [], "covariance": []}'):
        (tmp_path / "p.json").write_text(text)
        with pytest.raises(InputError, match=r"p\.json: is no prior of a fleet"):
            FleetPrior.read(tmp_path / "p.json")
    with pytest.raises(InputError, match="no such file"):
        FleetPrior.read(tmp_path / "none.json")


def test_too_few_robots_teach_nothing_and_the_bundle_that_is_written_takes_no_part(model, tmp_path):
    fleet = fleet_of(tmp_path, model, FEWEST)
    assert priors_of(fleet)["ur10e"].robots == tuple(f"r{k}" for k in range(FEWEST))
    assert priors_of(fleet, tmp_path / "r0") == {}
    with pytest.raises(UserError, match="too few for a prior"):
        prior_for(fleet, "ur10e", tmp_path / "r0")


def test_parameters_that_the_fleet_does_not_know_keep_the_descriptions_prior(model, tmp_path):
    taught = priors_of(fleet_of(tmp_path, model, 6))["ur10e"]
    described = prior(model.layout, ROBOT, inertial_parameters(Arm(ROBOT)), 100.0, STEP)
    part = FleetPrior("ur10e", taught.names[:3], taught.mean[:3], taught.covariance[:3, :3], taught.robots)
    belief = part.on(described, model.layout)
    precision = belief.precision_matrix()
    assert belief.mean[:3] == pytest.approx(taught.mean[:3]) and (belief.mean[3:] == described.mean[3:]).all()
    assert precision[:3, :3] == pytest.approx(np.linalg.inv(taught.covariance[:3, :3]))
    assert np.diag(precision)[3:] == pytest.approx(described.deviation[3:] ** -2.0)


@pytest.mark.long(seconds=4)
def test_with_the_prior_a_new_robot_needs_less_data(model, tmp_path):
    taught = priors_of(fleet_of(tmp_path, model, 12))["ur10e"]
    short = [recording(model, 0, seed=31, rows=300)]
    later = [recording(model, k, seed=32, rows=700) for k in range(3)]

    def held_out(prior):
        fit = fit_grey_box(ROBOT, short, STEP, 1, lambda _: None, learned=prior)
        errors = [s.P - p for s, p in zip(later, predictions(fit.model, later), strict=True)]
        return np.concatenate([error - error.mean() for error in errors]).std()

    assert held_out(taught) < 0.8 * held_out(None)


def test_train_refuses_a_prior_that_does_not_fit(closed, model, tmp_path):
    fleet_of(tmp_path, model, 2)
    ds = closed[0] / "before" / "ds"
    for words, said in (
        (("--network", "grey-box", "--prior", tmp_path / "plant.toml"), "too few for a prior"),
        (("--network", "7x1dim", "--prior", tmp_path / "plant.toml"), "--prior is for"),
        (("--network", "grey-box", "--prior", tmp_path / "none.json"), "none.json: no such file"),
    ):
        assert said in refused(acqd_here("train", ds, *words, "--out", tmp_path / "b"))
    assert not (tmp_path / "b").exists()


def test_a_bundle_says_from_whom_its_prior_is(closed, model, tmp_path):
    from acqd.models.bundle.bundle import load_bundle

    fleet_of(tmp_path, model, 6)
    words = ("--network", "grey-box", "--prior", tmp_path / "plant.toml", "--out", tmp_path / "b")
    done = acqd_here("train", closed[0] / "before" / "ds", *words)
    assert done.returncode == 0, done.stderr
    assert load_bundle(tmp_path / "b").metadata["prior"]["robots"] == [f"r{k}" for k in range(6)]


def test_robots_that_differ_in_gain_alone_are_one_robot_to_the_power(model, tmp_path):
    power, gain = powers(model.layout), model.layout.part("gain").start
    lines = ["[defaults]", "model = '{name}'", "dataset = 'ds'"]
    for k, factor in enumerate((0.7, 0.85, 1.0, 1.15, 1.3, 1.45)):
        values = model.values * factor**-power  # torques smaller, losses larger, as the gain is larger
        values[gain] *= factor
        again = GreyBox(model.chain, model.layout, values, model.step_s, model.usual_signals())
        short = [recording(model, 0, seed=31, rows=300)]
        np.testing.assert_allclose(predictions(again, short)[0], predictions(model, short)[0], rtol=0.02)
        entries = table(model.layout, values, np.diag((0.01 * values) ** 2))
        save_bundle(tmp_path / f"r{k}", grey_bundle(parameters=entries))
        lines.append(f"[robots.r{k}]")
    (tmp_path / "plant.toml").write_text("\n".join(lines))
    taught = priors_of(read_fleet(tmp_path / "plant.toml"))["ur10e"]
    pooled = GreyBox(model.chain, model.layout, taught.mean, model.step_s, model.usual_signals())
    np.testing.assert_allclose(predictions(pooled, short)[0], predictions(model, short)[0], rtol=0.04)
    at_common, _ = compared(model.values, power, gain, float(taught.mean[gain]))
    torques = power == 1.0
    away = np.abs(taught.mean - at_common)[torques] / np.abs(at_common[torques]).clip(1e-9)
    assert away[np.abs(at_common[torques]) > 0.1].max() < 0.03
