"""Requirements with hashes out of pip's report, and the list of packages that is kept in the repository."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

from tools.lock import locked

ROOT = Path(__file__).parents[2]


def normal(name: str) -> str:
    """A package's name as PEP 503 compares it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def test_every_archive_has_its_hash_and_the_project_itself_is_left_out():
    def package(name, **download):
        return {"metadata": {"name": name, "version": "1.0"}, "download_info": download}

    archive = {"hashes": {"sha256": "ab" * 32}}
    report = {"install": [package("acqd", dir_info={"editable": True}), package("NumPy", archive_info=archive)]}
    assert locked(report) == [f"numpy==1.0 --hash=sha256:{'ab' * 32}"]


def test_lock_and_list_of_packages_hold_every_dependency_in_the_version_of_the_constraints():
    """A dependency that was added without `make sbom` is missing here."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["postgres"]]
    names = {normal(re.match(r"[\w.-]+", one)[0]) for one in wanted}
    lines = [line.split(" --hash=sha256:") for line in (ROOT / "requirements.lock").read_text().splitlines()]
    lock = {normal(package.split("==")[0]): package.split("==")[1] for package, _ in lines}
    pinned = (line.split("==") for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line)
    constraints = {normal(name): version for name, version in pinned}
    components = json.loads((ROOT / "acqd.cdx.json").read_text())["components"]
    listed = {normal(one["name"]): one["version"] for one in components}
    assert names <= lock.keys()
    assert all(version == constraints.get(name, version) for name, version in lock.items())
    assert lock.items() <= listed.items()
