"""Labels of rows as text."""

import numpy as np

from acqd.robot.labels import from_cells, from_numbers


def test_names_stay_as_they_are_and_whole_numbers_lose_their_decimals():
    cells = ["007", "10_20", "1E2", "12.0", "12", " Fügen 2 ", "nan", "", None, "1.50", "2.000000000000000000e+00"]
    assert from_cells(cells).tolist() == ["007", "10_20", "1E2", "12", "12", "Fügen 2", "", "", "", "1.50", "2"]
    assert from_cells([20240915123456, 20240915123457]).tolist() == ["20240915123456", "20240915123457"]
    assert from_cells([2.0, float("nan"), True]).tolist() == ["2", "", "1"]
    assert from_numbers(np.array([20240915123456.0, 2.5, np.nan, -3.0])).tolist() == ["20240915123456", "2.5", "", "-3"]
