"""The proposals as files: save.json, save.html, and per cycle time the motion and the program."""

from __future__ import annotations

from pathlib import Path

import orjson

from acqd.atomic import complete_folder
from acqd.motion.chain import Move
from acqd.motion.program_file import program_text
from acqd.motion.program_text import programs, streamed, timed_joints
from acqd.saving.page import write_page
from acqd.saving.proposals import Proposal, Savings
from acqd.saving.tables import as_json

_SLOWLY = 0.05
"""Share of the limits on the way to the start, which nobody has checked."""
_CHECK = (
    "Proposed by acqd save for {robot}: {seconds:.1f} s. A person has to check this program before the robot moves: "
    "reach, tool, load, people, and whether the process allows other times. Collisions were checked for the described "
    "arm in scene '{scene}' only, and not on the way to the start: drive there by hand. Run it at reduced speed first."
)
_BRAKES = " The controller has to close the brakes after {after:g} s of standstill."
_UNBLENDED = " Corners are blended in program.toml and not here, so that this program takes longer."


def write_all(folder: Path, found: Savings) -> None:
    """Fill the folder, completely or not at all. Raises UserError, OperationError."""
    with complete_folder(folder) as out:
        for name, block in {"equal": found.equal, "other": found.other}.items():
            if block.proposals and block.proposals[-1].saving > 0:
                (out / name).mkdir()
                for file, text in _texts(found, block.proposals[-1]).items():
                    (out / name / file).write_text(text, encoding="utf-8")
        (out / "save.json").write_bytes(orjson.dumps(as_json(found), option=orjson.OPT_INDENT_2))
        write_page(out / "save.html", found)


def _texts(found: Savings, proposal: Proposal) -> dict[str, str]:
    """Text by file name."""
    robot, motion = found.subject.arm.description, proposal.motion
    warning = _CHECK.format(robot=robot.name, seconds=motion.seconds, scene=found.asked.scene)
    if proposal.brakes_after is not None:
        warning += _BRAKES.format(after=proposal.brakes_after)
    start = Move(motion.q[0], _SLOWLY, _SLOWLY)
    texts = {"motion.csv": timed_joints(motion, signals=True)}
    if proposal.program is None:
        return texts | streamed(robot, start, motion, warning, "acqd_save")
    texts["program.toml"] = program_text(proposal.program, robot, warning)
    if any(isinstance(step, Move) and step.blend_after < 1 for step in proposal.program.steps):
        warning += _UNBLENDED
    return texts | programs(robot, start, proposal.program.steps, warning, "acqd_save")
