"""The list of packages has the scripts that are shipped, as they are shipped."""

import json

from tests.places import ROOT
from tools.vendored import components


def test_the_list_has_the_shipped_scripts_and_their_licences():
    listed = json.loads((ROOT / "acqd.cdx.json").read_text())["components"]
    for component in components():
        assert component in listed, "python -m tools.vendored"
        path = ROOT / component["properties"][0]["value"]
        assert component["version"] in path.read_text()[:200]
        name = path.name.partition(".")[0]
        assert "MIT" in (path.parent / f"{name}.LICENSE").read_text()
    assert f'"three": "{components()[1]["version"]}"' in (ROOT / "tools" / "three" / "package.json").read_text()
