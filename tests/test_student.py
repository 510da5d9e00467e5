"""Student's t without scipy.stats."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.stats import t

from acqd import student


@pytest.mark.parametrize("freedom", [1, 2, 3.5, 24, 200])
def test_student_is_that_of_scipy(freedom):
    x, p = np.array([-40.0, -1.0, 0.3, 9.0]), np.array([1e-9, 0.02, 0.7, 0.975])
    np.testing.assert_allclose(student.cdf(x, freedom), t.cdf(x, freedom), rtol=1e-12)
    np.testing.assert_allclose(student.logsf(x, freedom), t.logsf(x, freedom), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(student.ppf(p, freedom), t.ppf(p, freedom), rtol=1e-12)
    np.testing.assert_allclose(student.isf(p, freedom), t.isf(p, freedom), rtol=1e-12)


def test_what_has_no_probability_is_no_warning():
    assert student.logsf(np.inf, 5) == -np.inf


def test_the_loop_leaves_large_libraries_alone():
    """Each takes tens of MB and a part of a second."""
    code = (
        "import sys, acqd.discrepancy.loop, acqd.discrepancy.report.write; "
        "print(*{'scipy.stats', 'scipy.signal', 'torch', 'pandas', 'matplotlib.pyplot'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not done.stdout.split()
