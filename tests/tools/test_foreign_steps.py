"""The steps of a case of the foreign study in this process."""

import pytest

from tools.studies.foreign.steps import InThisProcess, StepError


def test_what_acqd_refuses_is_a_result_of_the_study_and_no_end(tmp_path):
    steps, nothing = InThisProcess(), tmp_path / "nothing"
    (tmp_path / "power.csv").write_text("time,P\n0,1\n")
    (tmp_path / "logs").mkdir()
    with pytest.raises(StepError, match=r"acqd dataset build: power .*fewer than three rows"):
        steps.build(tmp_path / "power.csv", tmp_path / "logs", "iiwa7_r800", tmp_path / "ds", lag_s=0.0, cut_s=None)
    with pytest.raises(StepError, match=r"acqd train: .*nothing: no such folder"):
        steps.train(nothing, tmp_path / "model")
    with pytest.raises(StepError, match=r"acqd close-loop: .*nothing"):
        steps.close(nothing, nothing, tmp_path / "loop")
