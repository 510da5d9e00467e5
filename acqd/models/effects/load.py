"""Bodies that the model does not know."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.effect import Effect, Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.robot.newton_euler import Frames, frames, joint_torque, weight_torque


def pressed(scene: Scene) -> Floats:
    """[N] W per N up on the flange: what holds a weight there, the other way round."""
    held = weight_torque(_frames(scene), scene.axes - 1, scene.model.chain.beyond_flange(0.0))
    return -_power(scene, held) / 9.81


def _frames(scene: Scene) -> Frames:
    """Computed once a scene."""
    if "frames" not in scene.moved:
        scene.moved["frames"] = frames(scene.model.chain, scene.q)
    found: Frames = scene.moved["frames"]
    return found


def _power(scene: Scene, torque: Floats) -> Floats:
    """[N] W that an additional torque at the motors takes (by the scene's power per torque)."""
    return np.asarray((scene.power_per_torque * torque).sum(axis=1))


def _carried(scene: Scene, reach_m: float) -> Floats:
    """[N] W of 1 kg so far beyond the flange: its inertial parameters are a polynomial of the reach."""
    if "bodies" not in scene.moved:
        chain = scene.model.chain
        samples = [_point_mass(chain.beyond_flange(reach)) for reach in (-1.0, 0.0, 1.0)]
        scene.moved["bodies"] = [_torque(scene, body) for body in samples]
    if "carried" not in scene.computed:
        powers = [_power(scene, torque) for torque in scene.moved["bodies"]]
        scene.computed["carried"] = (powers[1], (powers[2] - powers[0]) / 2, (powers[2] + powers[0]) / 2 - powers[1])
    constant, linear, square = scene.computed["carried"]
    return np.asarray(constant + reach_m * linear + reach_m**2 * square)


def _torque(scene: Scene, body: Floats) -> Floats:
    """[N, axes] Nm of a body with inertial parameters [10] on the last link."""
    whole = np.zeros(10 * scene.axes)
    whole[-10:] = body
    return joint_torque(scene.model.chain, whole, scene.q, scene.qd, scene.qdd)


def _point_mass(place: Floats) -> Floats:
    """[10] inertial parameters of 1 kg at `place` (m) in a link's frame."""
    x, y, z = place
    return np.array([1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])


class Payload(Effect):
    """A body at the flange."""

    id = "payload"
    by_torque = True
    summary = "the arm carries a mass that the model does not know"
    equation = "tau = m Y(q, qd, qdd; centre of mass)"
    neighbours = ("gravity_bias", "copper_loss")
    experiment = "the same motion with the gripper empty and with a known mass, tool vertical and horizontal"
    shapes = ({"centre_of_mass_m": 0.0}, {"centre_of_mass_m": 0.06}, {"centre_of_mass_m": 0.15})
    bounds: ClassVar = {"centre_of_mass_m": (-0.1, 0.4)}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Always, and while the tool is on."""
        always = _carried(scene, shape["centre_of_mass_m"])
        return np.column_stack([always, *([always * scene.signals["tool"]] if "tool" in scene.signals else [])])

    def places(self, scene: Scene) -> Iterator[Place]:
        """Always, or with the tool."""
        yield Place("flange", (0,), (Parameter("mass", "kg"),))
        if "tool" in scene.signals:
            yield Place("flange, while the tool is on", (1,), (Parameter("mass", "kg"),))


class GravityBias(Effect):
    """Weight on a link, or a spring: hoses, a dress pack, a counterweight gone missing."""

    id = "gravity_bias"
    by_torque = True
    summary = "one link is heavier (or lighter) than the model has it: hoses, a dress pack, a cover gone"
    equation = "tau = m g(q; link)"
    neighbours = ("payload",)
    experiment = "hold ten postures for ten seconds each, and move each joint alone through the vertical"

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Per link but the first, whose weight does nothing when the base is upright."""
        links = scene.model.group("inertial").reshape(-1, 10)
        found = []
        for k in range(1, scene.axes):
            mass = max(float(links[k, 0]), 1e-3)
            centre = np.clip(links[k, 1:4] / mass, -0.5, 0.5)
            found.append(_power(scene, weight_torque(_frames(scene), k, centre)))
        return np.column_stack(found)

    def places(self, scene: Scene) -> Iterator[Place]:
        """Links."""
        for k in range(1, scene.axes):
            yield Place(f"link {k + 1}", (k - 1,), (Parameter("mass", "kg"),))


class ContactForce(Effect):
    """The tool pushes against something, now and then."""

    id = "contact_force"
    summary = "the tool pushes against something for some seconds at a time"
    equation = "tau = -J(q)^T F while in contact"
    neighbours = ("process_load", "payload")
    experiment = "log the joint torques, or the times of contact"
    predictable = False
    structural = False

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Mean power of 1 N up on the flange, once the residual has told how long it acts."""
        if not shape:
            return np.zeros((len(scene.q), 0))
        return shape["share_of_time"] * pressed(scene)[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """None beforehand."""
        return iter(())
