"""Models trained on the campaign of the thesis' quick reproduction; to look at, not to write into."""

import json
from pathlib import Path

import pytest

from tests.commands import acqd_here, without_workers


@pytest.fixture(scope="session")
def trained(study, once):
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
                done = acqd_here("train", study.training, "--network", network, *more, "--models", folder, "--json")
            assert done.returncode == 0, done.stderr
            for bundle in json.loads(done.stdout):
                results[Path(bundle["bundle"]).name] = bundle
        return results

    return once("trained", make)


@pytest.fixture(scope="session")
def logs(study):
    """Of the campaign, in the order of their sessions."""
    return sorted((study.out / "training" / "logs").rglob("*.log"))
