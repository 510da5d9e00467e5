"""`acqd close-loop` on recordings with a spring, which no effect of the library is."""

import json

import numpy as np
import pytest

from acqd.models.bundle.restore import open_model
from tests.builders import recording, write_dataset
from tests.commands import acqd_here
from tests.discrepancy.independent import column, extra_power

STIFFNESS = 12.0


def spring(scene, random):
    return extra_power(scene, column(scene, 2, STIFFNESS * (scene.q[:, 2] - 0.1)))


@pytest.fixture(scope="module")
def corrected(closed, model, once):
    """The loop's folder, and what the command printed."""

    def make(folder):
        rows = [recording(model, k, spring, seed=2, rows=600, start_s=1e9 + 9000) for k in range(6)]
        ds = write_dataset(folder / "now", rows)
        done = acqd_here("close-loop", ds, "--model", closed[0] / "model", "--out", folder / "loop")
        assert done.returncode == 0, done.stderr
        return done.stdout

    folder, printed = once("corrected", make)
    return folder / "loop", printed


@pytest.mark.slow("cli.close_loop")
def test_the_report_says_what_was_corrected_and_that_the_cause_is_unknown(corrected):
    folder, printed = corrected
    report = json.loads((folder / "report.json").read_text())
    assert report["verdict"] == "unknown_structure" and report["effects"] == []
    found = report["correction"]
    assert found["follows"] == "a torque that depends on the angle of joint 3" and found["where"] == "joint 3"
    stiffness, unit = found["looks_like"].removeprefix("a spring of ").split()
    assert float(stiffness) == pytest.approx(STIFFNESS, rel=0.15) and unit == "Nm/rad"
    assert report["after"]["rmse"] == pytest.approx(report["before"]["rmse"] - found["delta_rmse"])
    assert report["after"]["rmse"] < 1.3 * report["reference_rmse"] < report["before"]["rmse"]
    assert f"up to {found['size']['value']:.3g} Nm" in " ".join(printed.split()) and "cause unknown" in printed
    page = (folder / "report.html").read_text()
    assert "Correction without a name" in page and "does not say what causes it" in page
    assert "angle of joint elbow [rad]" in page


@pytest.mark.slow("cli.close_loop", "fmu")
def test_the_repaired_bundle_predicts_with_the_law_and_becomes_an_fmu(corrected, tmp_path):
    fmpy = pytest.importorskip("fmpy")
    folder, _ = corrected
    size = json.loads((folder / "report.json").read_text())["correction"]["size"]
    _, model = open_model(folder / "model")
    assert [term.id for term in model.terms] == ["torque_of_angle"]
    q = np.zeros((50, model.axes))
    q[:, 2] = 1.0
    bare = model.without("torque_of_angle")
    brakes_open = np.ones((50, len(model.signals)))
    assert np.abs(model.sequence(q, brakes_open) - bare.sequence(q, brakes_open)).max() > 0.1
    done = acqd_here("export-fmu", folder / "model", "--out", tmp_path / "robot.fmu")
    assert done.returncode == 0, done.stderr
    variables = {v.name: v for v in fmpy.read_model_description(str(tmp_path / "robot.fmu")).modelVariables}
    law = variables["torque_of_angle.size"]
    assert float(law.start) == pytest.approx(size["value"]) and law.unit == "Nm"
    assert "a torque that depends on the angle of a joint (joint 3)" in law.description
