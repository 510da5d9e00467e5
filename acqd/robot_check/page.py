"""The check of a description as a self-contained HTML page."""

from __future__ import annotations

from acqd.report import KeyFigure, Page, Verdict
from acqd.report.digits import counted
from acqd.robot_check.check import Check
from acqd.robot_check.excitation import SECONDS
from acqd.robot_check.pictures import arm_picture, influence_picture
from acqd.robot_check.sensitivity import GUESSED_FACTOR, KNOWN_FACTOR


def check_page(check: Check) -> Page:
    """The page, not yet written."""
    robot = check.robot
    page = Page(f"Robot description {robot.name}: {robot.title}", simulated=False)
    page.verdict(_verdict(check))
    page.figure(
        arm_picture(robot),
        "Orange: frames of base, joints and flange; thin: joint axes (dashed: prismatic); blue: centres of mass, area "
        "by mass; grey: collision capsules.",
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
    page.figure(influence_picture(power.influences), "The largest influences.")
    page.table(
        ["joint", "key", "value", "unit", "", "RMS change [W]"],
        [
            (each.joint, each.key, each.value, each.unit, "guessed" if each.guessed else "", each.change_W)
            for each in power.influences
        ],
    )
    page.heading("Joints")
    page.table(
        ["joint", "kind", "limits", "speed", "acceleration", "effort", "mass [kg]", "gain [Nm/A or N/A]"],
        [
            (
                joint.name,
                joint.kind,
                f"{joint.limits[0]:g} to {joint.limits[1]:g} {'m' if joint.slides else 'deg'}",
                f"{joint.speed:g} {'m/s' if joint.slides else 'deg/s'}",
                f"{joint.acceleration:g} {'m/s²' if joint.slides else 'deg/s²'}",
                f"{joint.effort:g} {'N' if joint.slides else 'Nm'}",
                joint.link.mass,
                joint.drive.effort_per_ampere,
            )
            for joint in robot.joint
        ],
    )
    page.heading("Sources")
    for source in robot.sources:
        page.text(source)
    return page


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
        return Verdict("fine", "Nothing in the description is implausible", "", figures)
    headline = f"{counted(len(check.findings), 'finding')} to look at"
    return Verdict("open", headline, "", figures, [each.advice for each in check.findings][:3])
