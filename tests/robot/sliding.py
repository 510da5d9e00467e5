"""Robots with prismatic joints: descriptions made from a few numbers."""

from acqd.robot.description import RobotDescription

DRIVE = {"gear_ratio": 100, "rotor_inertia_kgm2": 0.5, "torque_constant_Nm_A": 0.1, "resistance_Ohm": 0.5}
SLIDE = {"gear_ratio_rad_m": 300, "rotor_mass_kg": 8, "torque_constant_Nm_A": 0.1, "resistance_Ohm": 0.5}


def link(mass, com=(0, 0, 0), inertia=(0.01, 0.01, 0.01, 0, 0, 0)):
    return {"mass": mass, "com": com, "inertia": inertia}


def slide(name, axis, body, **more):
    keys = {"limits_m": [-1, 1], "speed_m_s": 1, "acceleration_m_s2": 5, "force_N": 500, "drive": SLIDE}
    return {"name": name, "kind": "prismatic", "xyz": [0, 0, 0], "axis": axis, "link": body} | keys | more


def turn(name, axis, body, **more):
    keys = {"limits_deg": [-180, 180], "speed_deg_s": 90, "acceleration_deg_s2": 400, "torque_Nm": 50, "drive": DRIVE}
    return {"name": name, "xyz": [0, 0, 0], "axis": axis, "link": body} | keys | more


def robot(*joints, name="made"):
    whole = {"name": name, "title": name, "sources": ["made"], "base": {"mass": 1}, "joint": list(joints)}
    return RobotDescription.model_validate(whole | {"flange": {"xyz": [0, 0, 0.1]}})


def scara():
    """Turn, turn, slide, turn: all kinds of neighbours, tilted frames, bodies without symmetry."""
    body = (0.03, 0.04, 0.05, 0.001, 0.002, 0.003)
    return robot(
        turn("j1", [0, 0, 1], link(5, (0.2, 0.01, 0.05), body), xyz=[0, 0, 0.3]),
        turn("j2", [0, 0.1, 1], link(3, (0.1, 0, 0.02), body), xyz=[0.4, 0, 0], rpy_deg=[5, 10, 0]),
        slide("j3", [0.1, 0, -1], link(2, (0, 0.03, 0.1), body), xyz=[0.3, 0, 0], rpy_deg=[0, 20, 30]),
        turn("j4", [0, 0, 1], link(1, (0.01, 0.02, 0.03), body), xyz=[0, 0.01, 0.1]),
    )
