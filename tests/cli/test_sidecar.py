"""`acqd sidecar` as a user runs it."""

import pytest

from acqd.storage.database import open_database
from tests.commands import acqd_here


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("none", "--model", "{bundle}", "--database", "p.sqlite"), "none is not a folder"),
        (("logs", "--model", "logs", "--database", "p.sqlite"), "no bundle"),
        (("logs", "--model", "{bundle}", "--database", "x.sqlite"), "no such file"),
        (("logs", "--model", "{bundle}", "--database", "p.sqlite", "--live", "--no-mqtt"), "--no-mqtt"),
    ],
)
def test_bad_arguments_are_one_line(tmp_path, bundle, words, told):
    (tmp_path / "logs").mkdir()
    open_database(str(tmp_path / "p.sqlite"))
    result = acqd_here("sidecar", *(word.format(bundle=bundle) for word in words), "--until-idle", cwd=tmp_path)
    assert result.returncode == 2 and told in result.stderr
    assert len([line for line in result.stderr.splitlines() if "warning" not in line.lower()]) == 1, result.stderr
