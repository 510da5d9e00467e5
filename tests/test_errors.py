"""Errors for users."""

import pickle

from acqd.errors import InputError, UserError


def test_a_worker_tells_bad_input_as_one_line(tmp_path):
    """InputError has a constructor of its own and must survive the way back from another process."""
    error = pickle.loads(pickle.dumps(InputError("x.csv", "row 3 is empty")))
    assert isinstance(error, UserError) and str(error) == "x.csv: row 3 is empty"
