"""An editable installation, used from the folder above the clone."""

import subprocess
import sys
import zipfile

import pytest

from tests.places import ROOT

pytest.importorskip("setuptools", minversion="77.0.3", reason="an older setuptools cannot build acqd")


def test_acqd_is_found_from_the_folder_above_the_clone(tmp_path):
    clone = tmp_path / "acqd"
    clone.mkdir()
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE", "acqd"):
        (clone / name).symlink_to(ROOT / name)
    script = f"from setuptools import build_meta; print(build_meta.build_editable({str(tmp_path)!r}))"
    built = subprocess.run([sys.executable, "-c", script], cwd=clone, capture_output=True, text=True, check=True)
    with zipfile.ZipFile(tmp_path / built.stdout.splitlines()[-1]) as wheel:
        wheel.extractall(tmp_path / "site", [name for name in wheel.namelist() if "/" not in name])
    # as pip installs the wheel: `site` reads its .pth file; the folder of the command comes first
    script = f"import site; site.addsitedir({str(tmp_path / 'site')!r}); import acqd; print(acqd.__file__)"
    found = subprocess.run(
        [sys.executable, "-S", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True,
        env={"PATH": "/usr/bin:/bin"},
    )  # fmt: skip
    assert found.stdout.strip() == str(clone / "acqd/__init__.py")
