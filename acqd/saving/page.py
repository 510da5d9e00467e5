"""The proposals for the engineer (save.html): what would have been used, how sure that is, and how the arm moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acqd.models.effects.cause import Cause
from acqd.motion.controller import RATE
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.bars import Bar, Bars
from acqd.report.digits import duration, number, percent, quantity
from acqd.report.lines import Chart, Line, Panel
from acqd.report.verdict import Tone
from acqd.saving.proposals import Block, Savings
from acqd.saving.tables import HEADER, headline, joules, table, what_if_text

_SHOWN_PER_S = 25
_LEAST_J = 0.05
"""Less is shown as zero: energy that is stored and comes back."""


def write_page(path: Path, found: Savings) -> None:
    """Write the page. Raises UserError."""
    subject = found.subject
    page = Page(
        f"Less energy: {subject.path.name}, {subject.arm.description.title}",
        simulated=subject.simulated,
        kind="saving",
        subject=subject.arm.description.name,
    )
    page.verdict(_verdict(found))
    page.lines(_pareto(found), "Energy of a cycle against its duration, as the model predicts it.")
    for title, block in (("Equal cycle time", found.equal), (_other_title(found), found.other)):
        page.heading(title)
        page.text(_compared(found, block))
        page.table(HEADER, table(block))
    for what_if in found.what_ifs:
        page.text(f"{what_if_text(what_if)}.".capitalize())
    for each in found.refused:
        page.text(f"Not proposed: {each.name}: {each.reason}.")
    page.text(_sure(found))
    page.heading("Where the energy goes")
    page.table(*_causes(found))
    best = found.best
    block, proposal = best if best else (found.equal, found.equal.proposals[-1] if found.equal.proposals else None)
    if proposal is not None:
        page.heading("Motion")
        page.lines(_motion(found, block), f"As it is, and {proposal.name}, in {duration(proposal.use.seconds)}.")
        page.bars(_speeds(found, block), "In the motion that is proposed.")
    page.heading("What the model cannot tell")
    for text in found.unknown:
        page.text(f"{text[0].upper()}{text[1:]}.")
    if subject.beyond > 0:
        page.text(
            f"{percent(subject.beyond)} of the rows of this motion lie outside of the motion that the model has "
            "learned from: it extrapolates there."
        )
    page.detail("model", subject.model_path)
    page.detail("motion", subject.path)
    page.detail("scene", found.asked.scene)
    page.write(path)


def steps(found: Savings) -> list[str]:
    """What to do with the program."""
    if found.best is None:
        return []
    folder = "equal" if found.best[0] is found.equal else "other"
    return [
        f"have a person check the program in {folder}/, drive to its start by hand, and run it at reduced speed first",
        "record power and the robot's log while it runs, and compare: acqd energy work has the energy of every cycle",
    ]


def _verdict(found: Savings) -> Verdict:
    best = found.best
    figures = [KeyFigure("a cycle as it is", joules(found.before.energy), duration(found.before.seconds))]
    standing = found.before.causes.get(Cause.STANDBY, 0.0)
    for block, label in ((found.equal, "equal cycle time"), (found.other, f"cycle of {duration(found.other.seconds)}")):
        if block.proposals:
            made = block.proposals[-1]
            share = percent(made.saving / block.instead.use.energy)
            figures.append(KeyFigure(f"{label}, best", share, f"{number(made.saving)} J, {made.verdict}"))
    tone: Tone = "found" if best else "fine"
    sentence = (
        f"{percent(standing / found.before.energy)} of the cycle's energy is standby, which no other motion saves: "
        "only a shorter cycle does."
    )
    return Verdict(tone, headline(found), sentence, figures, steps(found))


def _other_title(found: Savings) -> str:
    return f"Cycle of {duration(found.other.seconds)}"


def _compared(found: Savings, block: Block) -> str:
    if block is found.equal:
        return "The same path in the same time; one change at a time, and the best of all together."
    return (
        f"The same path in {duration(block.seconds)}, compared with the motion {block.instead.name}. Plain uniform "
        "slowing is what a speed override does."
    )


def _sure(found: Savings) -> str:
    doubt = found.subject.doubt
    if doubt is None:
        return "The model has no held-out recordings, so that nobody knows how wrong these savings are."
    return (
        f"The intervals are of the model's errors in differences, from {doubt.blocks} blocks of {doubt.recordings} "
        "recordings that it has not learned from. A saving whose interval holds zero is unprovable: this model cannot "
        "tell it from nothing."
    )


def _pareto(found: Savings) -> Chart:
    pareto = found.pareto
    lines = [
        Line("best timing", np.array(pareto.best), "after"),
        Line("plain uniform slowing", np.array(pareto.uniform), "before"),
        Line("as it is, then waiting", np.array(pareto.waiting), "muted"),
    ]
    beyond = [Line(line.name, line.values - np.array(pareto.standby), line.colour) for line in lines]
    alt = "Energy of a cycle against cycle time: best timing, uniform slowing, waiting"
    return Chart(
        np.array(pareto.seconds),
        "cycle time [s]",
        [Panel("energy [J]", lines, 180), Panel("beyond standby [J]", beyond, 220)],
        alt,
    )


def _causes(found: Savings) -> tuple[list[str], list[list[str]]]:
    blocks = [block for block in (found.equal, found.other) if block.proposals]
    columns = [("as it is", found.before)]
    columns += [(f"best, {duration(block.seconds)}", block.proposals[-1].use) for block in blocks]
    rows = [[cause.value, *(_shown(use.causes.get(cause, 0.0)) for _, use in columns)] for cause in found.before.causes]
    return ["cause", *(name for name, _ in columns)], rows


def _shown(energy: float) -> str:
    return quantity(energy if abs(energy) >= _LEAST_J else 0.0, "J", 3)


def _motion(found: Savings, block: Block) -> Chart:
    """Power and greatest speed of both motions over time."""
    old, new = found.subject.motion, block.proposals[-1]
    every = RATE // _SHOWN_PER_S
    rows = max(len(old), len(new.motion)) // every + 1
    speed = found.subject.arm.description.speed

    def padded(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values, np.full(max(rows - len(values), 0), np.nan)])[:rows]

    step = found.subject.meter.model.step_s
    t = np.arange(rows) / _SHOWN_PER_S

    def power(values: np.ndarray) -> np.ndarray:
        return np.asarray(np.interp(t, np.arange(len(values)) * step, values, right=np.nan))

    def share(qd: np.ndarray) -> np.ndarray:
        return padded(100 * (np.abs(qd[::every]) / speed).max(axis=1))

    panels = [
        Panel("power [W]", [Line("as it is", power(found.before.power), "before"),
                            Line("proposed", power(new.use.power), "after")], 220),
        Panel("speed [% of limit]", [Line("as it is", share(old.qd), "before"),
                                     Line("proposed", share(new.motion.qd), "after")], 160),
    ]  # fmt: skip
    return Chart(t, "time [s]", panels, "Power and speed over time, as it is and as proposed")


def _speeds(found: Savings, block: Block) -> Bars:
    robot = found.subject.arm.description
    shares = (np.abs(block.proposals[-1].motion.qd).max(axis=0) / robot.speed).tolist()
    return Bars(
        [Bar(joint.name, value, percent(value), "after") for joint, value in zip(robot.joint, shares, strict=True)],
        "Greatest speed of each joint as a share of its limit", whole=1.0,
    )  # fmt: skip
