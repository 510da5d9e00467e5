"""A designed program as files: timed joints, URScript, a Sunrise snippet, next.json, next.html."""

from __future__ import annotations

from pathlib import Path

import orjson

from acqd.atomic import complete_folder
from acqd.experiment.design import Designed, as_json
from acqd.experiment.page import write_page
from acqd.motion.chain import Move
from acqd.motion.program_text import programs, timed_joints
from acqd.report.chain import REPORT, connect

_SLOWLY = 0.05
"""Share of the limits on the way to the start, which nobody has checked."""
MOTION = "motion.csv"
_CHECK = "Designed by acqd next for {robot}: {seconds:.0f} s, begins with {gears} gears. A person has to check this "
_CHECK_2 = (
    "program before the robot moves: reach, tool, load, people. Collisions were checked for the described arm in "
)
_CHECK_3 = "scene '{scene}' only, and not on the way to the start: drive there by hand. Run it at reduced speed first."


def write_all(folder: Path, designed: Designed) -> None:
    """Fill the folder, completely or not at all. Raises UserError, OperationError."""
    robot, warning = designed.question.subject.robot, _warning(designed)
    slowly = tuple(min(_SLOWLY, share) for share in designed.space.greatest_shares)
    texts = programs(robot, Move(designed.space.home, *slowly), designed.steps, warning, "acqd_next")
    with complete_folder(folder) as out:
        for name, text in {MOTION: timed_joints(designed.motion), **texts}.items():
            (out / name).write_text(text, encoding="utf-8")
        (out / "next.json").write_bytes(orjson.dumps(as_json(designed), option=orjson.OPT_INDENT_2))
        write_page(out / "next.html", designed)
    connect(folder / "next.html", [designed.question.report / REPORT])


def _warning(designed: Designed) -> str:
    gears = "cold" if designed.cold else "warm"
    return (_CHECK + _CHECK_2 + _CHECK_3).format(
        robot=designed.question.subject.robot.name, seconds=designed.motion.seconds, gears=gears,
        scene=designed.asked.scene,
    )  # fmt: skip
