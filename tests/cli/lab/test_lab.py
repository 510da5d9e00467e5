"""`acqd lab` as a user runs it."""

import subprocess
import sys

import pytest

from tests.commands import acqd_here


def test_the_rest_of_acqd_starts_without_the_laboratorys_libraries():
    script = """
import sys
from acqd.cli.commands import command_tree
command_tree()
print([m for m in ('pinocchio', 'scipy', 'matplotlib', 'ray') if m in sys.modules])
"""
    done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["trajectories", "--out", "x", "--cube", "2", "0", "0.5", "0.2"], "cube at 2 0 0.5 m"),
        (["trajectories", "--out", "x", "--robot", "r2d2"], "robot 'r2d2' is unknown"),
        (["trajectories", "--out", "x", "--scene", "nowhere"], "scene 'nowhere' is unknown; known: digital_factory"),
        (["trajectories", "--out", "x", "--scene", "crate.toml", "--space", "all"], "box 'crate'"),
        (["execute", "short.csv", "--out", "x"], "short.csv: has 2 columns, but iiwa7_r800 has 7 axes"),
        (["execute", "back.csv", "--out", "x"], "back.csv: time goes from"),
        (["execute", "missing.csv", "--out", "x"], "missing.csv: no such file"),
        (["execute", "good.csv"], "give either --out FOLDER"),
        (["execute", "good.csv", "--out", "x", "--effect", "gremlins"], "effect 'gremlins' is unknown"),
        (["execute", "good.csv", "--out", "x", "--settings", "lab.toml"], "lab.toml: mains.voltage"),
        (["campaign", "--out", "x", "--limited", "0", "--all", "0"], "the campaign has no recordings"),
        (
            ["campaign", "--out", "x", "--limited", "1", "--all", "0", "--effect", "payload:from=9"],
            "campaign ends with 1",
        ),
        (["campaign", "--out", "x", "--effect", "encoder_bias:axis=9"], "the robot has the axes 1 to 7"),
        (["campaign", "--out", "x", "--settings", "typo.toml"], "typo.toml: effects 1: effect 'paylod' is unknown"),
        (["campaign", "--out", "x", "--settings", "odd.toml"], "odd.toml: window: expected whole milliseconds"),
        (["campaign", "--out", "x", "--truth", "x/truth"], "which an analyst may read"),
        (
            ["execute", "good.csv", "--out", "x", "--effect", "payload:at=1000"],
            "effect payload: at=1000, but good lasts only",
        ),
        (["execute", "good.csv", "--out", "x", "--effect", "payload:from=2"], "an execution has only one recording"),
        (["execute", "tiny.csv", "--out", "x"], "tiny.csv: has 30 rows over 0.00029 s"),
        (["trajectories", "--out", "good.csv/deep"], "good.csv/deep: cannot be made"),
        (["campaign", "--out", "full", "--limited", "1", "--all", "0"], "full is not empty"),
        (["campaign", "--out", "full/thesis.txt", "--limited", "1", "--all", "0"], "is a file, not a folder"),
        (["campaign", "--out", "x", "--profile", "use-case", "--robot", "ur3e"], "ur3e cannot reach"),
    ],
)
def test_bad_input_is_one_clear_line_and_leaves_nothing(tmp_path, arguments, complaint):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("mine")
    (tmp_path / "short.csv").write_text("1,2\n3,4\n")
    (tmp_path / "good.csv").write_text("0,0,0,0,0,0,0\n10,10,10,10,10,10,10\n")
    header = "time," + ",".join(f"q{k}" for k in range(1, 8))
    (tmp_path / "back.csv").write_text(header + "".join(f"\n{t},0,0,0,0,0,0,0" for t in (0, 1, 0.5, 2, 3, 4, 5, 6, 7)))
    (tmp_path / "lab.toml").write_text("[mains]\nvoltage = 12\n")
    (tmp_path / "tiny.csv").write_text(header + "".join(f"\n{k * 1e-5:.5f},0,0,0,0,0,0,0" for k in range(30)))
    (tmp_path / "typo.toml").write_text('[[effects]]\nid = "paylod"\n')
    (tmp_path / "odd.toml").write_text("window = 0.0425\n")
    crate = '[[box]]\nname = "crate"\ncentre = [0, 0, 1.0]\nsize = [0.6, 0.6, 0.3]\n'
    (tmp_path / "crate.toml").write_text('name = "crate"\n' + crate)
    done = acqd_here("lab", *arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert complaint in done.stderr and len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "x").exists() or not any((tmp_path / "x").iterdir())
