"""The vector functions in C against numpy, and builds with and without vectors against each other."""

import ctypes

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.c_builds import CBuild
from acqd.compiling import compile_shared, system_compiler
from acqd.fmu.package import _C as SOURCES

CODE = """
#include "lanes.h"
void exps(double *x) { lanes_to(lanes_exp(lanes_from(x)), x); }
void tanhs(double *x) { lanes_to(lanes_tanh(lanes_from(x)), x); }
void sines(double *x, double *c)
{
    lanes_t sine, cosine;
    lanes_sincos(lanes_from(x), &sine, &cosine);
    lanes_to(sine, x);
    lanes_to(cosine, c);
}
"""
FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-ffp-contract=off")


@pytest.fixture(scope="module", params=[(), ("-DACQD_ONE_LANE",)], ids=["vectors", "one lane"])
def functions(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lanes")
    (folder / "lanes.c").write_text(CODE)
    out = folder / "lanes.so"
    flags = (*FLAGS, *request.param, f"-I{SOURCES}")
    compile_shared(CBuild("lanes", (folder / "lanes.c",), flags, ""), [system_compiler()], out)
    return ctypes.CDLL(str(out))


def call(function, x, more=0):
    arrays = [np.full(4, x), *(np.empty(4) for _ in range(more))]
    function(*(array.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for array in arrays))
    return [float(array[0]) for array in arrays]


@given(x=st.floats(-700, 700))
@settings(deadline=None)
def test_the_exponential_is_exact_to_rounding(functions, x):
    (value,) = call(functions.exps, x)
    assert value == pytest.approx(np.exp(x), rel=2e-15)


@given(x=st.floats(-1e5, 1e5))
@settings(deadline=None)
def test_sine_and_cosine_are_exact_to_rounding(functions, x):
    sine, cosine = call(functions.sines, x, 1)
    assert sine == pytest.approx(np.sin(x), abs=1e-15)
    assert cosine == pytest.approx(np.cos(x), abs=1e-15)


@given(x=st.floats(-1e6, 1e6))
@settings(deadline=None)
def test_the_hyperbolic_tangent_is_exact_to_rounding(functions, x):
    (value,) = call(functions.tanhs, x)
    assert value == pytest.approx(np.tanh(x), abs=3e-16)
