"""A manifest that somebody has edited."""

import orjson
import pytest

from acqd.dataset.manifest import load_manifest
from acqd.errors import UserError

ENTRY = {"name": "a", "file": "recordings/a.parquet", "rows": 10, "valid_s": 0.4}
WHOLE = {"robot": "ur10e", "description": "ur10e", "step_s": 0.04, "measured": "mains", "refused": []}


@pytest.mark.parametrize(
    "wrong",
    [
        {"step_s": "0.04"},
        {"step_s": 0},
        {"recordings": 5},
        {"recordings": ["a"]},
        {"recordings": [ENTRY | {"file": 1}]},
        {"recordings": [ENTRY | {"rows": "10"}]},
    ],
)
def test_values_of_other_types_are_damage(tmp_path, wrong):
    manifest = WHOLE | {"recordings": [ENTRY]}
    (tmp_path / "manifest.json").write_bytes(orjson.dumps(manifest))
    assert load_manifest(tmp_path) == manifest
    (tmp_path / "manifest.json").write_bytes(orjson.dumps(manifest | wrong))
    with pytest.raises(UserError, match="is of another version of acqd, or damaged"):
        load_manifest(tmp_path)
