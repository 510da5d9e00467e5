"""Effects that acqd's library has no name for. A name given to one of them is wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from tools.studies.foreign.generator.arm import Floats
from tools.studies.foreign.generator.friction import direction
from tools.studies.foreign.generator.hidden.effect import Hidden
from tools.studies.foreign.generator.meter import walk
from tools.studies.foreign.generator.motion import STEP_S

if TYPE_CHECKING:
    from tools.studies.foreign.generator.plant import Session


def spring(session: Session, random: np.random.Generator) -> Hidden:
    """A spring on joint 3: a hose package."""
    angle = session.motion.q[:, 2] - random.uniform(-0.5, 0.5)
    return _on_joint(session, "spring", 2, angle, start=10.0, behind_gear=True)


def speed_product(session: Session, random: np.random.Generator) -> Hidden:
    """Friction of joint 2 proportional to the speed of joint 4: power goes with |qd2 qd4|."""
    qd = session.motion.qd
    return _on_joint(session, "speed_product", 1, direction(qd[:, 1]) * np.abs(qd[:, 3]), start=10.0)


def dead_zone(session: Session, random: np.random.Generator) -> Hidden:
    """Friction that begins above a speed."""
    joint, speed = int(random.integers(3)), float(random.uniform(0.3, 0.5))
    qd = session.motion.qd[:, joint]
    return _on_joint(session, "dead_zone", joint, np.sign(qd) * np.maximum(np.abs(qd) - speed, 0.0), start=10.0)


def backlash(session: Session, random: np.random.Generator) -> Hidden:
    """A spring behind a play: its torque depends on where the joint has turned back."""
    joint, width = int(random.choice([1, 2])), float(random.uniform(0.1, 0.25))
    angle = session.motion.q[:, joint]
    return _on_joint(session, "backlash", joint, (angle - play(angle, width)) / width, start=10.0)


def torque_hysteresis(session: Session, random: np.random.Generator) -> Hidden:
    """A torque that remembers where the load has turned back."""
    joint = 1
    load = session.rigid[:, joint] / session.plant.arm.torque[joint]
    return _on_joint(session, "torque_hysteresis", joint, load - play(load, 0.15), start=100.0)


def cubic_speed(session: Session, random: np.random.Generator) -> Hidden:
    """Friction that grows with the cube of the speed."""
    joint = int(random.integers(3))
    return _on_joint(session, "cubic_speed", joint, session.motion.qd[:, joint] ** 3, start=5.0)


def angle_friction(session: Session, random: np.random.Generator) -> Hidden:
    """Dry friction in one half of a joint's range."""
    joint = int(random.integers(3))
    inside = 1 / (1 + np.exp(-12 * (session.motion.q[:, joint] - random.uniform(-0.3, 0.3))))
    return _on_joint(session, "angle_friction", joint, direction(session.motion.qd[:, joint]) * inside, start=5.0)


def random_walk(session: Session, random: np.random.Generator) -> Hidden:
    """A load of the cabinet that wanders."""
    seconds = int(session.motion.t[-1]) + 2
    wander = walk(seconds, 1.0, 120.0, 1.0, random)
    return _load("random_walk", np.interp(session.motion.t, np.arange(seconds), wander))


def pulsation(session: Session, random: np.random.Generator) -> Hidden:
    """A load that swings like a sine with a period of 7 s about the power that it had before."""
    return _load("pulsation", np.sin(2 * np.pi * session.motion.t / 7.0 + random.uniform(0, 6)))


def lagging_pump(session: Session, random: np.random.Generator) -> Hidden:
    """A coolant pump that follows the drives' power behind two minutes."""
    keep = float(np.exp(-STEP_S / 120.0))

    def load(drives: Floats, mains: Floats, size: float) -> Floats:
        heat = np.abs(drives)
        late, _ = lfilter([1 - keep], [1.0, -keep], heat, zi=[keep * 0.5 * heat.mean()])
        return np.asarray(size * late)

    return Hidden(id="lagging_pump", place="cabinet", start=0.2, load=load)


def play(values: Floats, width: float) -> Floats:
    """The play operator: follows `values` [T] as soon as they are `width` away."""
    followed = np.empty_like(values)
    at = values[0]
    for row, value in enumerate(values.tolist()):
        at = min(max(at, value - width), value + width)
        followed[row] = at
    return followed


def _on_joint(
    session: Session, name: str, joint: int, values: Floats, *, start: float, behind_gear: bool = False
) -> Hidden:
    torque = np.zeros_like(session.motion.q)
    torque[:, joint] = values
    return Hidden(id=name, place=f"joint {joint + 1}", start=start, torque=torque, behind_gear=behind_gear)


def _load(name: str, values: Floats) -> Hidden:
    return Hidden(id=name, place="cabinet", start=10.0, load=lambda drives, mains, size: size * values)
