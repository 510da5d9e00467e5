"""`acqd energy causes`, and the sums behind it."""

import csv
import json
from collections import defaultdict

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from acqd.balance.balance import balance_of, mean_half_width
from acqd.balance.pictures import flows_of
from acqd.balance.rows import of_segments
from acqd.errors import UserError
from acqd.models.augmented import Augmented
from acqd.models.effects.cause import Cause
from acqd.models.yearly import HOURS_PER_YEAR, Duty, require_duty, yearly
from tests.builders import grey, recording, term
from tests.commands import acqd_here, refused
from tests.models.test_old_files import FOLDER

CAUSES = ("energy", "causes", FOLDER / "grey-box", FOLDER / "dataset")


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """JSON, and the folder of the files."""
    folder = tmp_path_factory.mktemp("causes")
    (folder / "tariff.toml").write_text('price = 0.3\nzone = "Europe/Berlin"\n')
    files = ("--csv", folder / "c.csv", "--html", folder / "c.html", "--tariff", folder / "tariff.toml")
    done = acqd_here(*CAUSES, *files, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), folder


def test_parts_and_residual_are_the_measured_energy(told):
    said, folder = told
    with (folder / "c.csv").open() as file:
        lines = list(csv.DictReader(file))
    for span in [*said["spans"], said["total"]]:
        parts = sum(part["kWh"] for part in span["parts"])
        assert parts == pytest.approx(span["predicted_kWh"], rel=1e-12)
        assert parts + span["residual"]["kWh"] == pytest.approx(span["measured_kWh"], rel=1e-9)
        assert sum(span["causes"].values()) == pytest.approx(parts, rel=1e-12)
        for part in span["parts"]:
            assert sum(part["joints_kWh"]) + part["of_no_joint_kWh"] == pytest.approx(part["kWh"], abs=1e-15)
        assert sum(part["EUR"] for part in span["parts"]) == pytest.approx(0.3 * parts)
        assert span["EUR"] == pytest.approx(0.3 * span["measured_kWh"])
        low, high = span["residual"]["ci95"] or (-np.inf, np.inf)
        assert low < span["residual"]["kWh"] < high
        if span["span"] != "all":
            own = [float(line["kWh"]) for line in lines if line["span"] == span["span"]]
            assert sum(own) == pytest.approx(span["measured_kWh"], rel=1e-9)
    year = said["years"]["standby"]
    assert year["EUR"] == pytest.approx(0.3 * year["kWh"])
    assert year["kWh"] == pytest.approx(
        said["total"]["causes"]["standby"] * HOURS_PER_YEAR * 3600 / said["total"]["seconds"]
    )


def test_the_page_is_one_file_with_both_pictures(told):
    text = (told[1] / "c.html").read_text()
    assert text.count('<svg role="img"') == 2 and "simulated data" in text and "http://" not in text
    assert "mains: " in text and "given back" in text and "joint 6" not in text


def test_tiles_without_a_tariff_show_neither_a_dash_nor_an_interval_that_is_none(tmp_path):
    done = acqd_here(*CAUSES, "--html", tmp_path / "c.html")
    text = (tmp_path / "c.html").read_text()
    assert done.returncode == 0, done.stderr
    assert "standby, a year" in text and "-; " not in text and "95 %: no interval" not in text
    assert "95 %: constant" not in text


def test_days_of_local_time(told):
    done = acqd_here(*CAUSES, "--by", "day", "--zone", "Europe/Berlin", "--json")
    said = json.loads(done.stdout)
    assert [each["span"][:4] for each in said["spans"]] == ["Sun "]  # 9 September 2001
    assert said["spans"][0]["measured_kWh"] == pytest.approx(told[0]["total"]["measured_kWh"])


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ((FOLDER / "network", FOLDER / "dataset"), "a network has no physical parts"),
        ((FOLDER / "grey-box", FOLDER / "dataset", "--by", "moon"), "expected recording, hour"),
        ((FOLDER / "grey-box", FOLDER), "manifest"),
        ((FOLDER / "grey-box", FOLDER / "dataset", "--csv", "c.txt"), "ends in .csv"),
        ((FOLDER / "grey-box", FOLDER / "dataset", "--zone", "Europe/Atlantis"), "zone 'Europe/Atlantis' is unknown"),
    ],
)
def test_bad_input_is_refused_with_a_line(words, why):
    assert why in refused(acqd_here("energy", "causes", *words))


def test_options_before_the_subcommand_are_refused():
    assert "put the options after" in refused(acqd_here("energy", "--tariff", "t.toml", *CAUSES[1:]))


def test_what_enters_the_supply_and_the_drives_leaves_them():
    base = grey()
    lighter = term("payload", {"centre_of_mass_m": 0.1}, -3.0)
    burning = term("regeneration_clipping", {"above_W": 0.0}, 0.5)
    rows = of_segments(Augmented(base, base, [lighter, burning]), [recording(base, k, rows=200) for k in (1, 2, 3)])
    balance = balance_of(rows, "total", np.full(len(rows.P), "all"), None)
    nodes, flows = flows_of(balance.total, rows.axes)
    entering, leaving = defaultdict(float), defaultdict(float)
    for flow in flows:
        leaving[nodes[flow.source].name] += flow.size
        entering[nodes[flow.target].name] += flow.size
    for name in ("supply", "drives"):
        assert entering[name] == pytest.approx(leaving[name], rel=1e-9)
    returned = balance.total.returned
    split = returned.to_joints + returned.to_electronics + returned.burnt + returned.to_mains
    assert split == pytest.approx(returned.joints.sum(), rel=1e-9) and returned.to_joints > 0
    assert 0 < returned.burnt <= balance.total.by_cause()[Cause.BURNT] * (1 + 1e-9)
    added = sum(each.kWh for each in balance.total.entries if each.added and each.cause == Cause.LOAD)
    assert balance.total.by_cause()[Cause.LOAD] == pytest.approx(added)


def test_the_interval_of_a_mean_is_that_of_equal_blocks():
    random = np.random.default_rng(1)
    values = np.repeat(random.normal(0, 1, 12), 50)
    interval = ttest_1samp(values[::50], 0.0).confidence_interval()
    half = mean_half_width(values, np.repeat(np.arange(12), 50))
    assert half == pytest.approx((interval.high - interval.low) / 2)
    assert mean_half_width(values[:200], np.repeat(np.arange(4), 50)) is None


def test_a_year_at_another_duty_weights_motion_and_rest():
    moving = [np.arange(100) < 40] * 6
    powers = [np.where(moves, 30.0, 10.0) for moves in moving]
    names = [f"r{k}" for k in range(6)]
    own, half_time = (yearly(names, powers, moving, Duty(share, 0.25)) for share in (None, 0.5))
    assert own.kWh == pytest.approx(18.0 * 8.76) and own.duty == 0.4 and own.half_kWh == pytest.approx(0.0, abs=1e-9)
    assert half_time.kWh == pytest.approx(20.0 * 8.76) and pytest.approx(0.25 * 20.0 * 8.76) == half_time.EUR
    sized = yearly(names, powers, moving, Duty(), size_error=0.1)
    assert sized.half_kWh == pytest.approx(0.1 * own.kWh)
    assert yearly(names[:1], powers[:1], moving[:1], Duty()).half_kWh is None
    with pytest.raises(UserError, match="no rest"):
        require_duty(Duty(0.5), [np.ones(5, dtype=bool)], "ds")
