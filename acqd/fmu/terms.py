"""Added effects as C: terms.h with one function per term, from the C bodies and constants of the effects' classes."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

import numpy as np

from acqd.arrays import Floats
from acqd.fmu.literals import literal
from acqd.fmu.variables import Parameters
from acqd.models.effects import holdable
from acqd.models.effects.effect import Effect
from acqd.models.greybox.model import GreyBox


def terms_header(parameters: Sequence[Parameters], carrier: GreyBox) -> str:
    """terms.h; the first parameter of every term follows the last one of the term before. Raises UserError."""
    functions: list[str] = []
    load: list[str] = []
    meter: list[str] = []
    first = 0
    for number, own in enumerate(parameters):
        effect = holdable()[own.term.id]
        functions.append(_function(f"term_{number}", effect, own, first, carrier))
        if effect.acts_on == "meter":
            meter.append(f"    power += term_{number}(predicted, volts, parameter);")
        else:
            load.append(f"    term_{number}(p, parameter, &power);\n    *result += power;")
        first += len(own.names)
    load_head = "static inline void load_terms(const point_t *p, const double *parameter, lanes_t *result)"
    load_start = ["    lanes_t power = ZERO;", "    (void)p, (void)parameter, (void)power;", "    *result = ZERO;"]
    meter_head = "static inline double meter_terms(double predicted, double volts, const double *parameter)"
    meter_start = ["    double power = 0.0;", "    (void)predicted, (void)volts, (void)parameter;"]
    functions += [
        "\n".join([load_head, "{", *load_start, *load, "}"]),
        "\n".join([meter_head, "{", *meter_start, *meter, "    return power;", "}"]),
    ]
    return "\n\n".join(["/* Generated: the terms of this model. */", *functions, ""])


def _function(name: str, effect: Effect, own: Parameters, first: int, carrier: GreyBox) -> str:
    lines = [f"/* {effect.id}, {_ascii(own.term.where)} */"]
    if effect.acts_on == "meter":
        lines.append(f"static inline double {name}(double predicted, double volts, const double *parameter)")
    else:
        lines.append(f"static inline void {name}(const point_t *p, const double *parameter, lanes_t *result)")
    lines += ["{", f"    double c[{_width(own, carrier)}] = {{0.0}};"]
    lines += [f"    c[{column}] = {value};" for column, value in _coefficients(own, first)]
    lines += [f"    {_constant(key, value)}" for key, value in effect.c_constants(carrier, own.term.shape).items()]
    body = textwrap.indent(textwrap.dedent(effect.c_body).strip(), "    ")
    if effect.acts_on == "torque":
        lines += ["    lanes_t torque[AXES];", "    for (int k = 0; k < AXES; k++)", "        torque[k] = ZERO;"]
        lines += [body, "    torque_power(p, torque, result);", "}"]
    elif effect.acts_on == "meter":
        lines += ["    double power;", "    (void)predicted, (void)volts;", body, "    return power;", "}"]
    else:
        lines += ["    lanes_t power = ZERO;", "    (void)p;", body, "    *result = power;", "}"]
    return "\n".join(lines)


def _width(own: Parameters, carrier: GreyBox) -> int:
    """Columns that a C body may index: at most four per joint, or the intervals of an event."""
    return max(4 * carrier.axes, 8, 1 + max(own.term.columns))


def _coefficients(own: Parameters, first: int) -> list[tuple[int, str]]:
    """Column and C expression: a combination of the FMU's parameters."""
    rows = []
    for column, weights in zip(own.term.columns, own.mix, strict=True):
        factors = [(weight, first + k) for k, weight in enumerate(weights) if weight]
        products = [f"parameter[{k}]" if w == 1.0 else f"{literal(w)} * parameter[{k}]" for w, k in factors]
        if products:
            rows.append((column, " + ".join(products)))
    return rows


def _constant(name: str, value: float | Floats) -> str:
    if isinstance(value, int):
        return f"const int {name} = {value};"
    array = np.asarray(value, dtype=np.float64)
    extent = "".join(f"[{size}]" for size in array.shape)
    return f"static const double {name}{extent} = {literal(array)};"


def _ascii(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9 ,.()_-]", "?", text)
