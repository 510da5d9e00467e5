"""The FMUs that the tests of this room share."""

import pytest

from acqd.fmu.package import export_fmu
from acqd.models.bundle.restore import open_model
from tests.fmu.bundles import make


@pytest.fixture(scope="session")
def made(once):
    """Bundles and their FMUs, made when they are asked for."""

    def get(kind, version="2.0"):
        bundle = once(f"bundle-{kind}", lambda folder: make(kind, folder))[1]
        name = f"{kind}-{version}.fmu"
        folder, _ = once(
            name.removesuffix(".fmu"),
            lambda folder: export_fmu(bundle, folder / name, version, ["linux64"], lambda _: None),
        )
        return open_model(bundle)[1], folder / name

    return get
