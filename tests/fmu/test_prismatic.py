"""A prismatic joint has no C source: the export says so and writes nothing."""

import pytest

from acqd.errors import UserError
from acqd.fmu.package import export_fmu
from acqd.models.bundle.bundle import save_bundle
from tests.builders import grey_bundle


def test_a_bundle_of_a_robot_with_a_slide_is_refused(tmp_path):
    bundle = grey_bundle()
    inputs = [{"name": f"q{k + 1}", "unit": "m" if k == 2 else "rad"} for k in range(6)]
    bundle.metadata["inputs"] = inputs
    save_bundle(tmp_path / "b", bundle)
    with pytest.raises(UserError, match="q3 is prismatic, and an FMU knows revolute joints only"):
        export_fmu(tmp_path / "b", tmp_path / "b.fmu", "2.0", ["linux64"], lambda _: None)
    assert not (tmp_path / "b.fmu").exists()
