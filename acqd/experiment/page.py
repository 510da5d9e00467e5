"""The designed recording for the engineer (next.html): what it promises, how it moves, what to do."""

from __future__ import annotations

from datetime import UTC, datetime
from itertools import count
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from acqd.discrepancy.selection.accepted import unnamed
from acqd.experiment.contest import Cause
from acqd.experiment.design import Designed
from acqd.motion.controller import RATE
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.bars import Bar, Bars
from acqd.report.digits import number, percent
from acqd.report.lines import Chart, Line, Panel
from acqd.report.verdict import Tone
from acqd.robot.kinematics import forward_kinematics

_SHOWN_PER_S = 20
_LEAST = 0.001
"""Smaller probabilities are said to be below."""


def write_page(path: Path, designed: Designed) -> None:
    """Write the page. Raises UserError."""
    question = designed.question
    page = Page(
        f"Next recording of {question.subject.robot.title}",
        simulated=question.subject.data.measured == "simulated", kind="next", subject=question.subject.robot.name,
        joints=question.subject.robot.joint_names,
    )  # fmt: skip
    page.verdict(tile(designed))
    if not designed.answered:
        page.bars(_bars(designed), "The mean over the causes, each weighted by its belief.")
        page.heading("What the recording would tell")
        page.text(
            "Probability that the loop names a cause, if that is what has changed: with the recordings so far, after "
            "the designed motion, and after two other motions of the same length: random motion between measured "
            "positions, and a D-optimal motion for the parameters of the model. All are expectations of the model, by "
            "the rules of the loop. What is believed of causes that are not compared counts as not named."
        )
        page.table(*table(designed))
    page.heading("Motion")
    page.text(
        f"{designed.motion.seconds:.0f} s, from and to one position. The session begins with "
        f"{'cold gears: let the robot stand for hours' if designed.cold else 'warm gears: let the robot work before'}."
    )
    page.lines(_angles(designed), "Positions of the joints, deg; of prismatic ones m.")
    page.figure(_path(designed), "Way of the flange from above and from the side, in the frame of the base.")
    rows = [[piece.name, f"{piece.seconds:.1f}"] for piece in designed.pieces]
    page.table(["piece of motion, in turn", "s"], rows)
    page.detail("report", question.report)
    page.detail("seed", designed.asked.seed)
    page.write(path)


def name_of(cause: Cause) -> str:
    """A cause in words."""
    candidate = cause.candidate
    return f"{candidate.id} ({candidate.label})" if candidate.id else unnamed(candidate.label)


def headline(designed: Designed) -> str:
    """What the program is worth, in a sentence."""
    now, after = (each.right(designed.causes) for each in (designed.so_far, designed.after))
    minutes = designed.motion.seconds / 60
    if designed.answered:
        names = " and ".join(f"{name} ({place})" for name, place in designed.question.named)
        return f"The name is not in doubt: {names}; no motion has to decide"
    if not designed.needed:
        return f"The recordings so far tell these causes apart ({share(now)}): no motion has to decide"
    if not designed.decides:
        return f"No motion of {minutes:.1f} min within these limits decides between the causes"
    if designed.unexpected:
        return (
            f"The recordings so far should have told these causes apart ({share(now)}), but the report leaves them "
            f"open: {minutes:.1f} min of motion ask once more ({share(after)})"
        )
    return f"{minutes:.1f} min of motion raise the right name from {share(now)} to {share(after)}"


def share(value: float) -> str:
    """A probability in percent; what rounds to nothing is said to be below."""
    return percent(value) if value >= _LEAST else f"below {percent(_LEAST)}"


def tile(designed: Designed) -> Verdict:
    """On top of the page."""
    now, after, random = (each.right(designed.causes) for each in (designed.so_far, designed.after, designed.random))
    figures = [
        KeyFigure("with the recordings so far", share(now), "right name"),
        KeyFigure("after the designed motion", share(after), "right name"),
        KeyFigure("after random motion", share(random), "of the same length"),
    ]
    causes = "; ".join(name_of(cause) for cause in designed.causes)
    if designed.answered:
        beside = f"Compared are, beside that name: {causes}. None of them need be there; --cause asks for others."
        return Verdict("fine", headline(designed), beside, [], [])
    tone: Tone = "found" if designed.decides else "open" if designed.needed else "fine"
    return Verdict(tone, headline(designed), f"Compared are: {causes}.", figures, steps(designed))


def steps(designed: Designed) -> list[str]:
    """What to do, with the lines to type; nothing where no recording has to decide."""
    if not designed.needed:
        return []
    if not designed.decides:
        return ["allow more minutes, speed or workspace, or log what is missing: this program would decide nothing"]
    config = designed.question.config
    known = {config.dataset, *config.further}
    further = next(
        path for k in count(2) if (path := config.dataset.with_name(f"{config.dataset.name}{k}")) not in known
    )
    again = ["acqd", "close-loop", str(config.dataset)]
    again += [word for path in [*config.further, further] for word in ("--with", str(path))]
    again += ["--model", str(config.bundle)]
    for name, value in (("--reference", config.reference), ("--robot", config.robot)):
        again += [] if value is None else [name, str(value)]
    again += [word for name in config.only for word in ("--only", name)]
    again += [word for name in config.exclude for word in ("--exclude", name)]
    if config.since_s is not None:
        again += ["--from", datetime.fromtimestamp(config.since_s, UTC).strftime("%Y-%m-%dT%H:%M:%S")]
    robot = designed.question.subject.data.description
    start = "after hours of standstill" if designed.cold else f"after {designed.worked_min / 60:g} hours of work"
    given = f"--cut {designed.cut_s:.1f}" + ("" if designed.cold else f" --worked {designed.worked_min:g}")
    return [
        "have a person check the program, drive to its start by hand, and run it at reduced speed first",
        f"record power and the robot's log while the program runs, {start}",
        f"acqd dataset build --power POWER --logs LOGS --robot {robot} --out {further} {given}",
        " ".join(again),
    ]


def table(designed: Designed) -> tuple[list[str], list[list[str]]]:
    """A header, and a row per cause."""
    header = ["cause", "believed", "evidence", "now", "designed", "random", "D-optimal", "closest rival after it"]
    outlooks = (designed.so_far, designed.after, designed.random, designed.for_parameters)
    return header, [
        [
            name_of(cause), share(cause.believed), number(cause.evidence),
            *(share(float(each.named[k])) for each in outlooks), designed.after.closest[k],
        ]
        for k, cause in enumerate(designed.causes)
    ]  # fmt: skip


def _bars(designed: Designed) -> Bars:
    named = (
        ("designed motion", designed.after, "after"), ("D-optimal motion", designed.for_parameters, "muted"),
        ("random motion", designed.random, "muted"), ("recordings so far", designed.so_far, "before"),
    )  # fmt: skip
    rows = []
    for name, outlook, colour in named:
        value = outlook.right(designed.causes)
        rows.append(Bar(name, value, share(value), colour))  # type: ignore[arg-type]
    return Bars(rows, "Probability of the right name", whole=1.0)


def _angles(designed: Designed) -> Chart:
    every = RATE // _SHOWN_PER_S
    motion, robot = designed.motion, designed.question.subject.robot
    t = np.arange(0, len(motion), every) / RATE
    panels = []
    for k, joint in enumerate(robot.joint):
        q = motion.q[::every, k]
        panels.append(Panel(joint.name, [Line("position", q if joint.slides else np.degrees(q))], 90))
    return Chart(t, "time [s]", panels, f"Positions of {robot.axes} joints over {motion.seconds:.0f} s")


def _path(designed: Designed) -> Figure:
    position, _ = forward_kinematics(designed.space.arm, designed.motion.q[:: RATE // _SHOWN_PER_S])
    figure = Figure(figsize=(9, 4.2), layout="constrained")
    both = figure.subplots(1, 2, gridspec_kw={"wspace": 0.1})  # letters of a page may be wider than those of the layout
    for axes, (a, b) in zip(both, ((0, 1), (0, 2)), strict=True):
        axes.plot(position[:, a], position[:, b], color="#2563eb", linewidth=0.8)
        axes.plot(*position[0, [a, b]], "o", color="#111827", markersize=5)
        axes.plot(0.0, 0.0, "s", color="#6b7280", markersize=7)
        axes.set_xlabel(f"{'xyz'[a]} [m]")
        axes.set_ylabel(f"{'xyz'[b]} [m]")
        axes.set_aspect("equal", adjustable="datalim")
    return figure
