"""The check of a description as a self-contained HTML page."""

from __future__ import annotations

from collections.abc import Sequence

from acqd.report import KeyFigure, Page, Verdict
from acqd.report.bars import Bar, Bars, ranked
from acqd.report.digits import counted, number
from acqd.robot_check.check import Check
from acqd.robot_check.excitation import SECONDS
from acqd.robot_check.pictures import arm_picture
from acqd.robot_check.sensitivity import GUESSED_FACTOR, KNOWN_FACTOR, Influence

_SHOWN = 12
"""Bars; the others are in a folded table."""


def check_page(check: Check) -> Page:
    """The page, not yet written."""
    robot = check.robot
    page = Page(f"Robot description {robot.name}: {robot.title}", simulated=False, kind="robot", subject=robot.name)
    page.verdict(_verdict(check))
    page.figure(
        arm_picture(robot),
        "Every joint axis has its number and is dashed if the joint is prismatic; the area of a centre of mass is by "
        "its mass.",
        alt="The arm in two postures: frames, joint axes, centres of mass and collision capsules",
    )
    page.heading("Findings")
    if check.findings:
        rows = [(each.state, each.where, each.finding, each.advice) for each in check.findings]
        page.table(["", "joint and key", "finding", "what to do"], rows)
    else:
        page.text("Nothing implausible.")
    page.heading("What is guessed")
    page.table(["joint", "guessed"], [(name, ", ".join(keys) or "nothing") for name, keys in check.guesses.items()])
    page.heading("What matters for the power")
    power = check.power
    page.text(
        f"Over {SECONDS:.0f} s of motion within the described limits, the description predicts {power.mean_W:.0f} W on "
        f"average, {power.peak_W:.0f} W at most, with a standard deviation of {power.deviation_W:.0f} W, without "
        f"standby power. Every value is multiplied and divided by a factor, one at a time: {GUESSED_FACTOR:g} where "
        f"guessed, {KNOWN_FACTOR:g} otherwise. Training determines most of these values from measured power; those at "
        "the top are worth a look at the nameplate first."
    )
    page.bars(
        _ranking(power.influences[:_SHOWN]),
        f"A guessed value times {GUESSED_FACTOR:g}, another times {KNOWN_FACTOR:g}.",
    )
    with page.folded(f"All {len(power.influences)} values"):
        page.table(
            ["joint", "key", "RMS change [W]", "value", "unit", "origin"],
            [
                (each.joint, each.key, each.change_W, each.value, each.unit, "guessed" if each.guessed else "described")
                for each in power.influences
            ],
        )
    page.heading("Joints")
    page.table(
        ["joint", "number", "kind", "limits", "speed", "acceleration", "effort", "mass [kg]", "gain [Nm/A or N/A]"],
        [
            (
                joint.name,
                place,
                joint.kind,
                f"{joint.limits[0]:g} to {joint.limits[1]:g} {'m' if joint.slides else 'deg'}",
                f"{joint.speed:g} {'m/s' if joint.slides else 'deg/s'}",
                f"{joint.acceleration:g} {'m/s²' if joint.slides else 'deg/s²'}",
                f"{joint.effort:g} {'N' if joint.slides else 'Nm'}",
                joint.link.mass,
                joint.drive.effort_per_ampere,
            )
            for place, joint in enumerate(robot.joint, start=1)
        ],
    )
    page.heading("Sources")
    for source in robot.sources:
        page.text(source)
    return page


def _ranking(influences: Sequence[Influence]) -> Bars:
    rows = [
        Bar(
            f"{each.joint} {each.key}{' (guessed)' if each.guessed else ''}",
            each.change_W,
            f"{number(each.change_W)} W",
            "before" if each.guessed else "muted",
        )
        for each in influences
    ]
    return ranked(rows, "RMS change of the predicted power [W]")


def _verdict(check: Check) -> Verdict:
    power, guessed = check.power, sum(map(len, check.guesses.values()))
    first = next((each for each in power.influences if each.guessed), None)
    figures = [
        KeyFigure("predicted power", f"{power.mean_W:.0f} W", f"at most {power.peak_W:.0f} W, without standby power"),
        KeyFigure("guessed", counted(guessed, "value"), f"in {counted(len(check.guesses), 'part')}"),
    ]
    if first is not None:
        figures.append(
            KeyFigure("guess that matters most", f"{first.change_W:.1f} W RMS", f"{first.joint} {first.key}")
        )
    if not check.findings:
        steps = (
            [] if first is None else [f"Look up or measure {first.joint} {first.key}: it is guessed, and matters most"]
        )
        if check.doubt:
            sentence = f"No value is out of its range, but {check.doubt}."
            return Verdict("open", "Plausible, and guessed where it matters", sentence, figures, steps)
        return Verdict("fine", "The description is plausible", "No value is out of its range.", figures, steps)
    headline = f"{counted(len(check.findings), 'finding')} to look at"
    return Verdict("open", headline, "", figures, [each.advice for each in check.findings][:3])
