"""A small campaign and the models trained on it; to look at, not to write into."""

import json
from pathlib import Path

import pytest

from acqd.lab.campaign.run import run_campaign
from tests.campaigns import order, quiet
from tests.commands import acqd


@pytest.fixture(scope="session")
def built(once):
    """A folder with campaign/ and its dataset, ds/, and what `acqd dataset build` said."""
    settings = {
        "limited": 6, "all_space": 6, "limited_sources": 3, "all_space_sources": 3, "session": 6, "seed": 21,
    }  # fmt: skip

    def make(folder):
        made = order(folder, 2, **settings)
        run_campaign(made, quiet)
        where = ("--power", made.out / "power.sqlite", "--logs", made.out / "logs", "--robot", "iiwa7_r800")
        done = acqd("dataset", "build", *where, "--out", folder / "ds", "--json")
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return once("trainable", make)


@pytest.fixture(scope="session")
def campaign(built):
    return built[0]


@pytest.fixture(scope="session")
def trained(campaign, once):
    """What `acqd train` says of each bundle, by name; they are in ds.models next to the dataset."""

    def make(_):
        results = {}
        for network, more in (
            ("grey-box", ()),
            ("hybrid", ()),
            ("21x1dim", ("--epochs", 40, "--seed", 1, "--seed", 2)),
            ("3conv1x5", ("--epochs", 5)),
        ):
            done = acqd("train", campaign / "ds", "--network", network, *more, "--json")
            assert done.returncode == 0, done.stderr
            for bundle in json.loads(done.stdout):
                results[Path(bundle["bundle"]).name] = bundle
        return results

    return once("trained", make)[1]
