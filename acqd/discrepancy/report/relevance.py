"""How large a change is for the robot: beside the model's own value, the torque limit, and in energy per day."""

from __future__ import annotations

import re

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.closed import Closed
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.terms import Reported
from acqd.discrepancy.report.main_parameter import changed_place, main_parameter
from acqd.models.effects import library
from acqd.models.effects.bodies import point_mass
from acqd.report.digits import confidence_interval, number, percent
from acqd.report.verdict import KeyFigure
from acqd.robot.newton_euler import Chain, joint_torque

_JOINT = re.compile(r"joint (\d+)$")
_EVERY = 10
"""Rows between two postures in which the load of the drives is looked at."""
_LEAST_SHARE = 0.005
"""Of a torque limit: less is not worth a word."""
_HOURS_PER_DAY, _W_PER_KW = 24.0, 1000.0


def compared_with_robot(subject: Subject, each: Reported) -> str:
    """The size beside what the robot has: "the model has 18 Nm; the change is 7 % of the limit"; "" if unknown."""
    return "; ".join(text for text in (_usual(subject, each), _load(subject, each)) if text)


def _usual(subject: Subject, each: Reported) -> str:
    """The same quantity in the model, which the effect comes on top of; "" where the model has none."""
    if subject.withheld or each.restored:
        return ""  # the model lacks the quantity altogether
    unit, group, joint = main_parameter(each)[1]["unit"], library()[each.term.id].usual, _joint_of(each)
    values = subject.carrier.group(group) if group else np.zeros(0)
    if len(values) == 1:
        return f"the {group} power of the model is {number(float(values[0]))} {unit}"
    if not group or joint is None:
        return ""
    usual = float(values[joint])
    return f"the model has {number(usual, 2)} {unit}" if usual > 0 else ""


def _joint_of(each: Reported) -> int | None:
    """Number of the joint, from 0, or None for another place."""
    match = _JOINT.search(changed_place(each))
    return int(match[1]) - 1 if match else None


def _load(subject: Subject, each: Reported) -> str:
    """Share of a joint's torque limit that the change takes; "" where no torque can be said."""
    effort = subject.robot.effort
    value, unit = float(main_parameter(each)[1]["value"]), main_parameter(each)[1]["unit"]
    joint = _joint_of(each)
    if unit in ("Nm", "N") and joint is not None:
        share = abs(value) / float(effort[joint])
        limit = f"{number(float(effort[joint]))} {unit}"
        return f"the change is {percent(share)} of the joint's limit of {limit}" if share >= _LEAST_SHARE else ""
    if "centre_of_mass_m" not in each.term.shape or value <= 0 or subject.robot.sliding:
        return ""
    shares = _holding_torque(subject, each, value) / effort
    joint = int(np.argmax(shares))
    if shares[joint] < _LEAST_SHARE:
        return ""
    return f"holding the mass takes up to {percent(float(shares[joint]))} of the torque limit of joint {joint + 1}"


def _holding_torque(subject: Subject, each: Reported, mass_kg: float) -> Floats:
    """[axes] Nm: the largest torque that the mass alone asks for in the postures of the recordings, at rest."""
    chain, body = Chain.of(subject.robot), np.zeros((subject.robot.axes, 10))
    body[-1] = mass_kg * point_mass(chain.beyond_flange(float(each.term.shape["centre_of_mass_m"])))
    q = np.concatenate([segment.q[::_EVERY] for segment in subject.fit])
    still = np.zeros_like(q)
    largest: Floats = np.abs(joint_torque(chain, body.ravel(), q, still, still)).max(axis=0)
    return largest


def mean_power(closed: Closed) -> list[KeyFigure]:
    """Power that the new terms add on average of the held-out recordings, per day; none if nothing was added.

    The interval is that of the recordings' means (normal approximation).
    """
    if not closed.extended:
        return []
    pairs = zip(closed.subject.held_out, closed.errors_before, closed.errors_after, strict=True)
    extra: dict[str, list[Floats]] = {}
    for segment, before, after in pairs:
        extra.setdefault(segment.recording, []).append(before - after)
    means = np.array([np.concatenate(each).mean() for each in extra.values()])
    mean_W = float(np.concatenate([row for each in extra.values() for row in each]).mean())
    half_W = 1.96 * float(means.std(ddof=1)) / np.sqrt(len(means)) if len(means) > 1 else np.inf
    note = f"{number(mean_W * _HOURS_PER_DAY / _W_PER_KW, 2)} kWh a day if the robot always moves as recorded"
    interval = confidence_interval((mean_W - half_W, mean_W + half_W), len(means))
    return [KeyFigure("power on average", f"{'+' if mean_W > 0 else ''}{number(mean_W)} W", f"{note}; {interval}")]
