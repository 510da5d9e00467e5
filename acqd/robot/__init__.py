"""Robots: descriptions as data files, kinematics, dynamics, collision, logs. Knows neither power nor the laboratory."""

from acqd.robot.description import RobotDescription, load_description, shipped_descriptions

__all__ = ["RobotDescription", "load_description", "shipped_descriptions"]
