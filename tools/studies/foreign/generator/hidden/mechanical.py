"""Bodies, forces and friction."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from tools.studies.foreign.generator.arm import Floats, point_mass
from tools.studies.foreign.generator.dynamics import force_torques, joint_torques
from tools.studies.foreign.generator.friction import direction
from tools.studies.foreign.generator.hidden.effect import Hidden
from tools.studies.foreign.generator.hidden.switching import bursts

if TYPE_CHECKING:
    from tools.studies.foreign.generator.plant import Session

_STRONG = 4
"""Joints from the base on whose friction matters for the power."""


def payload(session: Session, random: np.random.Generator) -> Hidden:
    """A body whose centre of mass lies off the flange's axis."""
    arm, motion = session.plant.arm, session.motion
    aside = random.uniform(0.03, 0.1) * _on_circle(random)
    local = np.array([*aside, random.uniform(0.02, 0.12)])
    body = point_mass(arm.joints - 1, arm.flange + arm.flange_turn @ local)
    torque = joint_torques(arm, [body], motion.q, motion.qd, motion.qdd)
    details = {"aside_m": float(np.hypot(*aside)), "centre_of_mass_m": float(local[2])}
    return _behind("payload", "flange", "kg", torque, details)


def gravity_bias(session: Session, random: np.random.Generator) -> Hidden:
    """A mass on an inner link: hoses, a cover."""
    arm, motion = session.plant.arm, session.motion
    link = int(random.choice([2, 3] if arm.joints > 6 else [1, 2]))
    centre = arm.bodies[link].centre + random.normal(0, 0.02, 3)
    torque = joint_torques(arm, [point_mass(link, centre)], motion.q, motion.qd, motion.qdd)
    return _behind("gravity_bias", f"link {link + 1}", "kg", torque, {})


def contact_force(session: Session, random: np.random.Generator) -> Hidden:
    """A force up, within 20 degrees, for some seconds at a time."""
    arm, motion = session.plant.arm, session.motion
    tilt = np.sin(np.radians(random.uniform(0, 20))) * _on_circle(random)
    up = np.array([*tilt, np.sqrt(1 - tilt @ tilt)])
    touching = bursts(motion.t, random, on_s=(3, 9), off_s=(12, 40)) * session.brake
    torque = force_torques(arm, motion.q, arm.flange, np.outer(touching, up / up[2]))  # the size is the part upwards
    return _behind("contact_force", "flange", "N", torque, {}, start=20.0)


def coulomb_friction(session: Session, random: np.random.Generator) -> Hidden:
    """Dry friction of one joint."""
    return _rubbing(session, random, "coulomb_friction", "Nm", lambda qd, _: direction(qd), start=5.0)


def viscous_friction(session: Session, random: np.random.Generator) -> Hidden:
    """Friction of one joint proportional to its speed."""
    return _rubbing(session, random, "viscous_friction", "Nm s/rad", lambda qd, _: qd, start=5.0)


def stribeck_friction(session: Session, random: np.random.Generator) -> Hidden:
    """Friction of one joint near standstill."""
    speed = float(random.uniform(0.08, 0.25))

    def law(qd: Floats, _: Floats) -> Floats:
        return np.asarray(direction(qd) * np.exp(-((qd / speed) ** 2)))

    return _rubbing(session, random, "stribeck_friction", "Nm", law, start=8.0, details={"speed_rad_s": speed})


def load_dependent_friction(session: Session, random: np.random.Generator) -> Hidden:
    """Friction of joint 2, or of all joints, proportional to the load."""
    return _rubbing(
        session, random, "load_dependent_friction", "-", lambda qd, load: direction(qd) * np.abs(load),
        start=0.1, loaded=True,
    )  # fmt: skip


def mechanical_power(session: Session, random: np.random.Generator) -> Hidden:
    """A share of the motor's torque is lost in the gear of joint 2, or in all gears."""
    whole = session.base_torque()
    return _rubbing(
        session, random, "mechanical_power", "-", lambda qd, _: direction(qd), start=0.1, loaded=True, by=np.abs(whole)
    )


def thermal_friction(session: Session, random: np.random.Generator) -> Hidden:
    """Cold grease in one gear at the start of the first recording."""
    minutes, t = float(random.uniform(4, 12)), session.motion.t
    cold = np.exp(-(t - t[session.motion.recordings[0].start]) / (60 * minutes))[:, None]
    joint = _strong_joint(session, random)
    torque = np.zeros_like(session.motion.qd)
    torque[:, joint] = (cold * session.motion.qd)[:, joint]
    return Hidden(
        id="thermal_friction", place=f"joint {joint + 1}", unit="Nm s/rad", start=8.0, torque=torque,
        details={"minutes": minutes}, truth=lambda size: size,
    )  # fmt: skip


def gear_ripple(session: Session, random: np.random.Generator) -> Hidden:
    """A torque that is periodic in one angle."""
    joint, periods = _strong_joint(session, random), float(random.integers(6, 30))
    torque = np.zeros_like(session.motion.q)
    torque[:, joint] = np.sin(periods * session.motion.q[:, joint] + random.uniform(0, 2 * np.pi))
    return Hidden(
        id="gear_ripple", place=f"joint {joint + 1}", unit="Nm", start=5.0, torque=torque, details={"periods": periods}
    )


def _rubbing(
    session: Session, random: np.random.Generator, name: str, unit: str, law: Callable[[Floats, Floats], Floats],
    *, start: float, details: dict[str, float] | None = None, loaded: bool = False, by: Floats | None = None,
) -> Hidden:  # fmt: skip
    """Friction `law` (speeds [T, n], loads [T, n]) times `by` [T, n]: one joint; loaded, joint 2 or all."""
    joint: int | None = 1 if random.random() < 0.5 else None
    if not loaded:
        joint = _strong_joint(session, random)
    chosen = slice(None) if joint is None else joint
    torque = np.zeros_like(session.motion.qd)
    torque[:, chosen] = law(session.motion.qd, session.rigid)[:, chosen]
    if by is not None:
        torque *= by
    return Hidden(
        id=name, place="all joints" if joint is None else f"joint {joint + 1}", unit=unit, start=start, torque=torque,
        details=details or {}, truth=lambda size: size,
    )  # fmt: skip


def _strong_joint(session: Session, random: np.random.Generator) -> int:
    return int(random.integers(_STRONG if session.plant.arm.joints > 6 else 3))


def _behind(name: str, place: str, unit: str, torque: Floats, details: dict[str, float], start: float = 1.0) -> Hidden:
    return Hidden(
        id=name, place=place, unit=unit, start=start, torque=torque, behind_gear=True, details=details,
        truth=lambda size: size,
    )  # fmt: skip


def _on_circle(random: np.random.Generator) -> Any:
    angle = random.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])
