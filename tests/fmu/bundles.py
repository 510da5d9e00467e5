"""A bundle of every kind that becomes an FMU."""

import numpy as np

from acqd.models.augmented import Term
from acqd.models.bundle.bundle import Bundle, save_bundle
from acqd.models.effects import library
from acqd.models.effects.laws import laws
from acqd.models.effects.laws.law import MotionRange
from acqd.models.effects.scene import make_scene
from acqd.models.features import padded
from acqd.models.greybox.bundle_io import arrays_of
from acqd.models.hybrid.model import Perceptron
from acqd.models.networks.architecture import ARCHITECTURES
from acqd.models.networks.flat_parameters import initial
from acqd.models.normalisation import Normalisation
from tests.builders import AXES, about, grey, grey_bundle

KINDS = [*ARCHITECTURES, "grey_box", "hybrid", "effects", "network_with_effects"]


def normal():
    random = np.random.default_rng(3)
    return Normalisation(random.normal(0, 0.2, (3, AXES)), random.uniform(0.8, 2.0, (3, AXES)), 180.0, 60.0)


def network_bundle(name):
    theta = initial(ARCHITECTURES[name], AXES, 1) + np.random.default_rng(2).normal(
        0, 0.05, ARCHITECTURES[name].learnables(AXES)
    ).astype(np.float32)
    return Bundle(about("network", architecture={"name": name}, normalisation=normal().as_json()), {"theta": theta})


def terms(model):
    """One term of every law, and of every effect that the library can foresee or average, in every place."""
    q = np.zeros((60, AXES)) + 0.1 * np.arange(60)[:, None] / 60
    scene = make_scene(model, padded(q, 2), {"brake": np.ones(60), "tool": np.ones(60)}, 0.0, np.full(60, 231.0))
    detected = {
        "gear_ripple": {"joint": 2.0, "periods_per_turn": 17.5},
        "thermostat": {"share_of_time": 0.4, "period_s": 100.0},
        "process_load": {"share_of_time": 0.2},
        "contact_force": {"share_of_time": 0.3},
    }
    random = np.random.default_rng(8)
    found = []
    for identity, effect in library().items():
        shape = detected.get(identity) or dict(effect.shapes[0])
        width = effect.at(scene, shape).shape[1]
        if identity in detected:
            found.append(term(identity, "somewhere", shape, tuple(range(width)), random.normal(0, 2, width), width))
            continue
        for place in effect.places(scene):
            count = len(place.parameters)
            theta = random.uniform(0.5, 1.5, count) * (1e-3 if identity in ("copper_loss", "clock_offset") else 1.0)
            weights = theta if place.mix is None else place.mix @ theta
            found.append(term(identity, place.where, shape, place.columns, weights, count, theta))
    covered = MotionRange(
        np.full(AXES, -0.5), np.full(AXES, 0.8), np.full(AXES, 1.5), np.full(AXES, 40.0), np.linspace(80, 200, 4)
    )
    for law in laws().values():
        width = law.count(AXES)
        joint = 2 if law.per_joint else 0
        shape = law.shape_of(covered, joint)
        found.append(term(law.id, law.label(joint), shape, tuple(range(width)), random.normal(0, 2, width), width))
    return found


def term(identity, where, shape, columns, weights, count, theta=None):
    values = weights if theta is None else theta
    parameters = {f"p{k}, as 0-20 ms": {"value": float(values[k]), "unit": "W", "ci95": None} for k in range(count)}
    parameters |= {name: {"value": value, "unit": "-", "ci95": None} for name, value in shape.items()}
    return Term(identity, where, shape, columns, np.asarray(weights, dtype=float), parameters)


def make(kind, folder):
    path = folder / kind
    if kind in ARCHITECTURES:
        bundle = network_bundle(kind)
    elif kind == "network_with_effects":
        bundle = network_bundle("21x1dim")
        bundle.metadata["carrier"] = {"signals": ["brake"]}
        bundle.arrays.update({f"carrier.{name}": value for name, value in arrays_of(grey()).items()})
        bundle.metadata["effects"] = [
            each.as_json() for each in terms(grey()) if each.id in ("payload", "tool_actuation")
        ]
    else:
        bundle = grey_bundle()
        if kind == "hybrid":
            random = np.random.default_rng(4)
            network = Perceptron(
                random.normal(0, 0.3, (12, 3 * AXES)), random.normal(0, 0.3, 12), random.normal(0, 3, 12)
            )
            rest = {"rest_W": network.W, "rest_b": network.b, "rest_out": network.out}
            bundle = Bundle(
                about("hybrid", signals=["brake"], normalisation=normal().as_json()), arrays_of(grey()) | rest
            )
        if kind == "effects":
            bundle.metadata["effects"] = [each.as_json() for each in terms(grey())]
    save_bundle(path, bundle)
    return path
