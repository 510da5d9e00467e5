"""Variables of an FMU: inputs, outputs and parameters of added effects, in the order of the C arrays."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from acqd.arrays import Floats
from acqd.models.augmented import Augmented, Term
from acqd.models.effects import holdable
from acqd.models.effects.laws import laws
from acqd.models.predictor import Predictor

_SIGNAL_UNITS = {"Vrms": "V"}
_SIGNALS = {
    "brake": "brakes open (1) or closed (0)",
    "tool": "tool on (1) or off (0)",
    "Vrms": "RMS mains voltage",
}


@dataclass(frozen=True, slots=True)
class Variable:
    """A scalar variable. Its value reference is its index in the list of all variables."""

    name: str
    causality: Literal["input", "output", "parameter"]
    unit: str
    description: str
    start: float = 0.0


@dataclass(frozen=True, slots=True)
class Parameters:
    """Parameters of one term. The coefficients of its columns are `mix` times these."""

    term: Term
    names: tuple[str, ...]
    units: tuple[str, ...]
    start: Floats
    mix: Floats
    """[columns, parameters]."""


def exported_terms(model: Predictor) -> list[Term]:
    """Added effects that the FMU holds."""
    return [term for term in _terms(model) if holdable()[term.id].exported]


def left_out(model: Predictor) -> list[str]:
    """Added effects that the FMU does not hold, with the reason, and assumptions about the others."""
    omitted = [(term, holdable()[term.id]) for term in _terms(model) if not holdable()[term.id].exported]
    notes = [f"{term.id} is left out: {effect.omitted_because}" for term, effect in omitted]
    notes += [note for term in exported_terms(model) if (note := holdable()[term.id].assumption(term.shape))]
    return list(dict.fromkeys(notes))


def _terms(model: Predictor) -> list[Term]:
    return model.terms if isinstance(model, Augmented) else []


def parameters_of(term: Term) -> Parameters:
    """Fitted parameters of a term. Columns in fixed proportions share one parameter, those of a law its size."""
    fitted = {name: value for name, value in term.parameters.items() if name not in term.shape}
    names, units = tuple(fitted), tuple(str(each["unit"]) for each in fitted.values())
    start = np.array([float(each["value"]) for each in fitted.values()])
    if term.id in laws():
        return Parameters(term, names, units, start, (term.coefficients / start[0])[:, None])
    if len(names) == len(term.coefficients):
        return Parameters(term, names, units, term.coefficients.copy(), np.eye(len(names)))
    if len(names) == 1 and start[0] != 0.0:
        return Parameters(term, names, units, start, (term.coefficients / start[0])[:, None])
    return Parameters(term, ("share",), ("1",), np.ones(1), term.coefficients[:, None])


def variables(model: Predictor) -> list[Variable]:
    """All variables except `reset`, in the order of the C arrays."""
    shown = [Variable(f"q{k + 1}", "input", "rad", f"angle of joint {k + 1}") for k in range(model.axes)]
    for name, usual in zip(model.signals, model.usual_signals(), strict=True):
        unit = _SIGNAL_UNITS.get(name, "1")
        shown.append(Variable(name, "input", unit, _SIGNALS.get(name, "logged signal"), float(usual)))
    delay = (
        f", delayed by {1000 * model.radius * model.step_s:.0f} ms: the look-ahead of the model" if model.radius else ""
    )
    shown.append(Variable("power", "output", "W", f"mains power{delay}"))
    shown.append(Variable("energy", "output", "kWh", "energy since the start or the last reset"))
    return [*shown, *_effect_variables(model)]


def _effect_variables(model: Predictor) -> Iterator[Variable]:
    seen: dict[str, int] = {}
    for term in exported_terms(model):
        seen[term.id] = seen.get(term.id, 0) + 1
        prefix = term.id + (f"_{seen[term.id]}" if seen[term.id] > 1 else "")
        own = parameters_of(term)
        for name, unit, start in zip(own.names, own.units, own.start, strict=True):
            description = f"{holdable()[term.id].summary} ({term.where})"
            yield Variable(f"{prefix}.{_identifier(name)}", "parameter", unit, description, float(start))


def _identifier(name: str) -> str:
    """Replace what FMI's structured names do not allow: all but letters, digits and underscores."""
    return re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")
