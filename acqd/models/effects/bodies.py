"""Bodies and forces on the arm, as power at the mains."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.scene import Scene
from acqd.robot.newton_euler import Chain, joint_torques

GRAVITY = 9.81
_LINK_TORQUES = "torques of bodies on links"
"""Key in `Scene.moved`."""


def weight_torques(scene: Scene, name: str, points: list[tuple[int, Floats]]) -> Floats:
    """[n, N, axes] Nm that hold 1 kg at each of n points [3] m in the frame of a link (from 0) against gravity.

    The scene keeps them under `name`: they depend on the motion only, and effects ask for them often.
    """
    known = scene.moved.setdefault(_LINK_TORQUES, {})
    if name not in known:
        still = np.zeros_like(scene.q)
        known[name] = _torques(scene, [(link, point_mass(point)) for link, point in points], (still, still))
    return np.asarray(known[name])


def link_torques(scene: Scene, name: str, bodies: list[tuple[int, Floats]]) -> Floats:
    """[n, N, axes] Nm of n bodies on links (from 0) with inertial parameters [10]; `name` as in `weight_torques`."""
    known = scene.moved.setdefault(_LINK_TORQUES, {})
    if name not in known:
        known[name] = _torques(scene, bodies)
    return np.asarray(known[name])


def powers(scene: Scene, torques: Floats) -> Floats:
    """[N, n] W of additional torques [n, N, axes] Nm at the motors, at the scene's power per torque."""
    return np.asarray(np.einsum("nj,knj->nk", scene.power_per_torque, torques))


def point_mass_torque(scene: Scene, reach_m: float) -> Floats:
    """[N, axes] Nm of 1 kg on the flange's axis, `reach_m` beyond the flange."""
    constant, linear, square = _quadratic(*_point_masses(scene))
    return np.asarray(constant + reach_m * linear + reach_m**2 * square)


def point_mass_power(scene: Scene, reach_m: float) -> Floats:
    """[N] W of 1 kg on the flange's axis, `reach_m` beyond the flange."""
    if "point_mass" not in scene.computed:
        scene.computed["point_mass"] = _quadratic(*powers(scene, _point_masses(scene)).T)
    constant, linear, square = scene.computed["point_mass"]
    return np.asarray(constant + reach_m * linear + reach_m**2 * square)


def first_moment_torques(scene: Scene, reach_m: float) -> Floats:
    """[2, N, axes] Nm per kg m of first moment beside the flange's axis, `reach_m` beyond the flange.

    The derivative of a point mass with respect to a shift along each of `across`.
    """
    here, beyond = _first_moments(scene)
    return np.asarray(here + reach_m * (beyond - here))


def first_moment_power(scene: Scene, reach_m: float) -> Floats:
    """[N, 2] W per kg m of first moment beside the flange's axis, `reach_m` beyond the flange."""
    if "first_moments" not in scene.computed:
        scene.computed["first_moments"] = [powers(scene, torques) for torques in _first_moments(scene)]
    here, beyond = scene.computed["first_moments"]
    return np.asarray(here + reach_m * (beyond - here))


def _point_masses(scene: Scene) -> Floats:
    """[3, N, axes] Nm of 1 kg on the flange's axis 1 m before the flange, at the flange, and 1 m beyond.

    A point mass has inertial parameters that are a quadratic polynomial of the reach; three samples determine it.
    """
    if "point_masses" not in scene.moved:
        chain = scene.model.chain
        samples = [point_mass(chain.beyond_flange(reach)) for reach in (-1.0, 0.0, 1.0)]
        scene.moved["point_masses"] = _last_link_torques(scene, samples)
    return np.asarray(scene.moved["point_masses"])


def _quadratic(before: Floats, here: Floats, beyond: Floats) -> tuple[Floats, Floats, Floats]:
    """Coefficients of 1, x and x^2 from values at -1, 0 and 1."""
    return here, (beyond - before) / 2, (beyond + before) / 2 - here


def _first_moments(scene: Scene) -> Floats:
    """[2, 2, N, axes] Nm per kg m beside the flange's axis, at the flange and 1 m beyond: linear in the reach."""
    if "first_moments" not in scene.moved:
        bodies = [body for reach in (0.0, 1.0) for body in first_moments(scene.model.chain, reach)]
        scene.moved["first_moments"] = _last_link_torques(scene, bodies)
    torques = scene.moved["first_moments"]
    return np.asarray(torques.reshape(2, 2, *torques.shape[1:]))


def first_moments(chain: Chain, reach_m: float) -> Floats:
    """[2, 10] inertial parameters per kg m of first moment beside the flange's axis."""
    return moments_about(chain.beyond_flange(reach_m), chain.tip[1])


def moments_about(place: Floats, along: Floats) -> Floats:
    """[2, 10] inertial parameters per kg m of first moment about `place` [3] m, in two directions across `along` [3].

    A point mass is quadratic in its place: central differences are exact derivatives.
    """
    return np.array([(point_mass(place + side) - point_mass(place - side)) / 2 for side in across(along)])


def across(along: Floats) -> Floats:
    """[2, 3] two unit vectors at right angles to the unit vector `along` [3].

    The first one lies in the plane of `along` and that axis of the frame which it resembles least.
    """
    start = np.eye(3)[int(np.argmin(np.abs(along)))]
    first = start - (start @ along) * along
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(along, first)])


def point_mass(place: Floats) -> Floats:
    """[10] inertial parameters (m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz) of 1 kg at `place` [3] m."""
    x, y, z = place
    return np.array([1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])


def link_centres(scene: Scene) -> Floats:
    """[axes, 3] m: centres of mass of the described links, at most 0.5 m from the joint."""
    return centres_of(scene.model.group("inertial"))


def centres_of(inertial: Floats) -> Floats:
    """[axes, 3] m from inertial parameters [10 axes], at most 0.5 m from the joint."""
    links = inertial.reshape(-1, 10)
    return np.clip(links[:, 1:4] / np.maximum(links[:, :1], 1e-3), -0.5, 0.5)


def _last_link_torques(scene: Scene, bodies: list[Floats]) -> Floats:
    """[n, N, axes] Nm of n bodies with inertial parameters [10] on the last link."""
    return _torques(scene, [(scene.axes - 1, body) for body in bodies])


def _torques(scene: Scene, bodies: list[tuple[int, Floats]], speeds: tuple[Floats, Floats] | None = None) -> Floats:
    """[n, N, axes] Nm of n bodies on links (from 0) with inertial parameters [10]; `speeds`: other qd and qdd."""
    arms = np.zeros((len(bodies), scene.axes, 10))
    for arm, (link, body) in zip(arms, bodies, strict=True):
        arm[link] = body
    return joint_torques(scene.model.chain, arms, scene.q, *(speeds or (scene.qd, scene.qdd)), turned=scene.turned)
