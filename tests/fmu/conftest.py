"""The FMUs that the tests of this room share."""

import pytest

from acqd.fmu.package import export_fmu
from acqd.models.bundle.restore import open_model
from tests.fmu.bundles import make


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """Bundles and their FMUs, made when they are asked for."""
    folder, cache = tmp_path_factory.mktemp("fmu"), {}

    def get(kind, version="2.0"):
        if kind not in cache:
            cache[kind] = make(kind, folder)
        file = folder / f"{kind}-{version}.fmu"
        if not file.exists():
            export_fmu(cache[kind], file, version, ["linux64"], lambda _: None)
        return open_model(cache[kind])[1], file

    return get
