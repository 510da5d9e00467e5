"""A model as C headers: model_size.h, model_data.h and terms.h, which the sources in `c` include."""

from __future__ import annotations

import hashlib

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.fmu.literals import Header, literal
from acqd.fmu.terms import terms_header
from acqd.fmu.variables import Parameters, exported_terms, parameters_of
from acqd.models.augmented import Augmented
from acqd.models.effects.substeps import substep_weights
from acqd.models.greybox.model import GreyBox
from acqd.models.hybrid.model import Hybrid
from acqd.models.networks.architecture import HIDDEN
from acqd.models.networks.predictor import NetworkPredictor
from acqd.models.normalisation import Normalisation
from acqd.models.predictor import Predictor
from acqd.robot.newton_euler import Chain


def sources(model: Predictor) -> dict[str, str]:
    """Names and contents of the headers. Raises UserError for a kind of model without C."""
    base = model.base if isinstance(model, Augmented) else model
    carrier = model.carrier if isinstance(model, Augmented) else base
    parameters = [parameters_of(term) for term in exported_terms(model)]
    grey = base.grey if isinstance(base, Hybrid) else base
    if not isinstance(base, NetworkPredictor | GreyBox | Hybrid):
        raise UserError(f"a model of the kind {type(base).__name__} cannot be exported")
    size = _size(model, base, parameters)
    data = Header()
    files: dict[str, str] = {}
    if isinstance(base, NetworkPredictor):
        _network(data, base)
    if isinstance(base, Hybrid):
        _perceptron(data, base)
    body = grey if isinstance(grey, GreyBox) else carrier if parameters else None
    if isinstance(body, GreyBox):
        data.array("JOINT_XYZ", body.chain.xyz)
        data.array("JOINT_TURN", _turns(body.chain))
        data.array("JOINT_AXIS", body.chain.axis)
    if isinstance(grey, GreyBox):
        data.lines.append(_grey("BASE", grey, model))
    if parameters and isinstance(carrier, GreyBox):
        _effects(data, carrier, model)
        files["terms.h"] = terms_header(parameters, carrier)
    data.array("SIGNAL_START", [*model.usual_signals(), 0.0])
    data.array("PARAMETER_START", [*(value for own in parameters for value in own.start), 0.0])
    files["model_size.h"] = size.text("ACQD_MODEL_SIZE_H")
    token = hashlib.sha256("".join([*files.values(), data.text("ACQD_MODEL_DATA_H")]).encode()).hexdigest()
    data.lines.append(
        f'#define MODEL_TOKEN "{{{token[:8]}-{token[8:12]}-{token[12:16]}-{token[16:20]}-{token[20:32]}}}"'
    )
    return files | {"model_data.h": data.text("ACQD_MODEL_DATA_H")}


def token_of(files: dict[str, str]) -> str:
    """The token that modelDescription.xml and the binary share."""
    line = next(line for line in files["model_data.h"].splitlines() if line.startswith("#define MODEL_TOKEN"))
    return line.split('"')[1]


def _size(model: Predictor, base: Predictor, parameters: list[Parameters]) -> Header:
    header = Header()
    network = isinstance(base, NetworkPredictor)
    header.define("AXES", model.axes)
    header.define("SIGNALS", len(model.signals))
    header.define("RADIUS", model.radius)
    header.define("STEP_S", repr(model.step_s))
    header.define("HAS_NETWORK", int(network))
    header.define("HAS_GREYBOX", int(not network))
    header.define("HAS_PERCEPTRON", int(isinstance(base, Hybrid)))
    header.define("HIDDEN", HIDDEN if network else 0)
    header.define("TERMS", len(parameters))
    header.define("PARAMETERS", sum(len(own.names) for own in parameters))
    for name, signal in (("BRAKE", "brake"), ("TOOL", "tool"), ("VOLTS", "Vrms")):
        header.define(name, model.signals.index(signal) if signal in model.signals else -1)
    return header


def _normal(data: Header, normal: Normalisation) -> None:
    data.array("Q_OFFSET", normal.offset)
    data.array("Q_SCALE", normal.scale)


def _network(data: Header, base: NetworkPredictor) -> None:
    arrays, chosen = base.arrays, base.architecture
    data.define("WIDTH", chosen.width(base.axes))
    data.define("KERNELS", chosen.kernels)
    data.define("KERNEL_LENGTH", chosen.length)
    data.define("INPUT_ORDERS", 1 if chosen.kernels else chosen.inputs.count(",") + 1)
    _normal(data, base.normal)
    if chosen.kernels:
        data.array("KERNEL", arrays["kernel"])
        data.array("KERNEL_BIAS", arrays["kernel_bias"])
    data.array("W_INPUT", arrays["W"].T)
    data.array("W_HIDDEN", arrays["R"].T)
    data.array("GATE_BIAS", arrays["b"])
    weight, bias = base.head()
    data.array("OUT", weight)
    data.define("OUT_BIAS", repr(bias))
    data.define("P_SCALE", repr(base.normal.P_scale))
    data.define("P_OFFSET", repr(base.normal.P_offset))


def _perceptron(data: Header, base: Hybrid) -> None:
    _normal(data, base.normal)
    data.define("PERCEPTRON_HIDDEN", len(base.network.b))
    data.array("PERCEPTRON_W", base.network.W)
    data.array("PERCEPTRON_BIAS", base.network.b)
    data.array("PERCEPTRON_OUT", base.network.out)


def _grey(name: str, grey: GreyBox, model: Predictor) -> str:
    weights = dict(zip(grey.signals, grey.group("signals").tolist(), strict=True))
    fields = [
        grey.group("inertial").reshape(-1, 10),
        *(grey.group(each) for each in ("rotor", "coulomb", "viscous", "copper", "conduction")),
        *(grey.group(each)[0] for each in ("gain", "lag", "standby", "sign_speed")),
        np.array([*(weights.get(signal, 0.0) for signal in model.signals), 0.0]),
    ]
    brake = model.signals.index("brake") if "brake" in grey.signals else -1
    return f"static const grey_t {name} = {{{','.join(literal(each) for each in fields)},{brake}}};"


def _turns(chain: Chain) -> Floats:
    """[axes, 3, 3, 3] R, R K, R K K per joint; the frame at an angle is R + sin R K + (1 - cos) R K K (Rodrigues)."""
    turns = []
    for rotation, (x, y, z) in zip(chain.rotation, chain.axis, strict=True):
        K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turns.append([rotation, rotation @ K, rotation @ K @ K])
    return np.array(turns)


def _effects(data: Header, carrier: GreyBox, model: Predictor) -> None:
    data.lines.append(_grey("CARRIER", carrier, model))
    data.array("SUBSTEP_WEIGHT", substep_weights(model.step_s).transpose(0, 2, 1))
