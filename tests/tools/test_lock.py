"""Requirements with hashes out of pip's report."""

from __future__ import annotations

from tools.lock import locked


def test_every_archive_has_its_hash_and_the_project_itself_is_left_out():
    def package(name, **download):
        return {"metadata": {"name": name, "version": "1.0"}, "download_info": download}

    archive = {"hashes": {"sha256": "ab" * 32}}
    report = {"install": [package("acqd", dir_info={"editable": True}), package("NumPy", archive_info=archive)]}
    assert locked(report) == [f"numpy==1.0 --hash=sha256:{'ab' * 32}"]
