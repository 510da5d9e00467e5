"""A campaign, its dataset, and models trained on it; to look at, not to write into."""

import json
from pathlib import Path

import pytest

from tests.campaigns import clocked, clocked_dataset
from tests.commands import acqd_here, without_workers


@pytest.fixture(scope="session")
def campaign(once):
    """Folder of a campaign of the laboratory."""
    return clocked("iiwa7_r800", once).out


@pytest.fixture(scope="session")
def training(once):
    """Folder of the campaign's dataset."""
    return clocked_dataset(clocked("iiwa7_r800", once), once)[0]


@pytest.fixture(scope="session")
def trained(training, once):
    """The folder of the bundles, and what `acqd train` says of each, by name."""

    def make(folder):
        results = {}
        for network, more in (
            ("grey-box", ()),
            ("hybrid", ()),
            ("21x1dim", ("--epochs", 40, "--seed", 1, "--seed", 2)),
            ("3conv1x5", ("--epochs", 5)),
        ):
            with without_workers():
                done = acqd_here("train", training, "--network", network, *more, "--models", folder, "--json")
            assert done.returncode == 0, done.stderr
            for bundle in json.loads(done.stdout):
                results[Path(bundle["bundle"]).name] = bundle
        return results

    return once("trained", make)


@pytest.fixture(scope="session")
def logs(campaign):
    """Of the campaign, in the order of their sessions."""
    return sorted((campaign / "logs").rglob("*.log"))
