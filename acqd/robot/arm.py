"""The Pinocchio model of a robot description, with or without a payload. Needs the `motion` extra."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from acqd.arrays import Floats
from acqd.robot.description import Link, RobotDescription


@dataclass(frozen=True, slots=True)
class Payload:
    """A body fixed to the flange."""

    mass: float
    """kg."""
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """In the flange frame [m]."""
    inertia: tuple[float, float, float, float, float, float] = (0.0,) * 6
    """xx, yy, zz, xy, xz, yz at its centre of mass [kg m^2]."""


class Arm:
    """The rigid-body model of a robot; joint positions and torques are in the order of its axes."""

    def __init__(self, description: RobotDescription, payload: Payload | None = None) -> None:
        self.description = description
        self.model: Any = pin.Model()
        self.model.name = description.name
        parent = 0
        for joint in description.joint:
            placement = pin.SE3(_rotation(joint.rpy_deg), np.array(joint.xyz))
            axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
            moves = pin.JointModelPrismaticUnaligned(axis) if joint.slides else pin.JointModelRevoluteUnaligned(axis)
            parent = self.model.addJoint(parent, moves, placement, joint.name)
            self.model.appendBodyToJoint(parent, _inertia(joint.link), pin.SE3.Identity())
        flange = pin.SE3(_rotation(description.flange.rpy_deg), np.array(description.flange.xyz))
        self.flange: int = self.model.addFrame(pin.Frame("flange", parent, 0, flange, pin.FrameType.OP_FRAME))
        if payload is not None and payload.mass > 0:
            body = pin.Inertia(payload.mass, np.array(payload.com), _tensor(payload.inertia))
            self.model.appendBodyToJoint(parent, body, flange)
        self.data: Any = self.model.createData()

    @property
    def axes(self) -> int:
        """Number of joints."""
        return self.description.axes


def _inertia(link: Link) -> Any:
    turn = _rotation(link.inertia_rpy_deg)
    tensor = turn @ _tensor(link.inertia) @ turn.T
    np.fill_diagonal(tensor, np.maximum(np.diag(tensor), 0.0))  # a rounded zero may be below
    return pin.Inertia(link.mass, np.array(link.com), tensor)


def _tensor(six: tuple[float, float, float, float, float, float]) -> Floats:
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _rotation(rpy_deg: tuple[float, float, float]) -> Floats:
    """Rotation matrix: roll about x, then pitch about y, then yaw about z of the fixed frame (URDF)."""
    rotation: Floats = pin.rpy.rpyToMatrix(np.radians(rpy_deg))
    return rotation
