"""Source distribution and wheel, built and used as somebody does who has neither the tree nor its environment."""

import subprocess
import tarfile
import zipfile

import pytest

from tests.places import ROOT
from tools.studies.packages.__main__ import USES, build, measure

pytestmark = pytest.mark.minutes
pytest.importorskip("build", reason="build is not installed: pip install build")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel that comes of the source distribution of the files that git knows."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    archive = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
    subprocess.run(["tar", "c", "--null", "-T", "-", "-f", source / "s.tar"], cwd=ROOT, input=archive, check=True)
    with tarfile.open(source / "s.tar") as files:
        files.extractall(source / "acqd", filter="data")
    return build(out, source / "acqd")


def test_the_wheel_is_complete(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    for needed in (
        "acqd/py.typed", "acqd/__init__.pyi", "acqd/daemon/acqd.toml", "acqd/share/config/mosquitto.acl",
        "acqd/share/systemd/acqd.service", "acqd/share/examples/close-the-loop.ipynb", "acqd/fmu/c/model.c",
    ):  # fmt: skip
        assert needed in names, needed
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in names)
    assert sum(name.startswith("acqd/prebuilt/window-") for name in names) >= 3
    sdist = next(wheel.parent.glob("*.tar.gz"))
    with tarfile.open(sdist) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    known = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    assert {name for name in known if not name.startswith(".git")} <= inside


@pytest.mark.parametrize("use", USES)
def test_every_use_works_with_its_extra_alone(wheel, use):
    assert "MB" in measure(wheel, use, USES[use], ROOT / "constraints.txt")
