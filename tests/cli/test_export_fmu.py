"""`acqd export-fmu` as a user runs it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from acqd.models.bundle.bundle import save_bundle
from tests.builders import grey_bundle
from tests.commands import acqd_here, refused


@pytest.mark.slow("cli.export_fmu")
def test_the_command_as_a_user_has_it(tmp_path):
    bundle = tmp_path / "b"
    save_bundle(bundle, grey_bundle())
    acqd = Path(sys.executable).with_name("acqd")
    done = subprocess.run([acqd, "export-fmu", bundle, "--json"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outputs"] == ["power", "energy"]
    assert (tmp_path / "b.fmu").exists()
    about = json.loads((bundle / "bundle.json").read_text())
    for broken in (json.dumps(about | {"kind": "transformer"}), "{"):
        (bundle / "bundle.json").write_text(broken)
        told = "'transformer'" if broken != "{" else "bundle.json"
        assert told in refused(acqd_here("export-fmu", bundle))
