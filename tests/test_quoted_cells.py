"""Rows whose quoted cells hold line breaks."""

import numpy as np
import pytest

from acqd.dataset.power_files import read_file
from acqd.quoted_cells import rejoined
from acqd.robot import load_description
from acqd.robot.log_reader import read_log
from acqd.sources import load_waveform
from tests.sources.files import write_csv

REMARK = '"a part\nwas picked, ""by hand"", and\nput down"'


def test_a_cell_of_three_lines_is_in_one_row():
    text = f"1,{REMARK},2\n3,,4\n".splitlines(keepends=True)
    whole = '1,"a part was picked, ""by hand"", and put down",2\n'
    assert list(rejoined(text)) == [(0, whole), (3, "3,,4\n")]


@pytest.mark.parametrize(
    "lines",
    [
        ['1,5",2', '3,6",4'],  # inches
        ['"1,2,3', '"4,5,6'],  # a quote at the start of each row
        ['1,"open', *["2,3"] * 20],
        ['1,"a, b",2', '3,"c ""d""",4'],
        ['1,"open', "2"],
    ],
)
def test_other_quotes_join_nothing(lines):
    assert [line for _, line in rejoined(lines)] == lines


def test_power_logs_and_waveforms_are_read_with_such_cells(tmp_path):
    rows = "".join(f"{1e9 + 0.04 * k:.2f},{REMARK if k == 2 else ''},{100 + k}\n" for k in range(5))
    (tmp_path / "power.csv").write_text(f'time,"remark\nof the shift",P\n{rows}')
    (power,) = read_file(tmp_path / "power.csv", None, None, [])
    np.testing.assert_array_equal(power.P, [100, 101, 102, 103, 104])
    q = ",".join(f"q{k}" for k in range(1, 8))
    rows = "".join(f"{0.04 * k:.2f}{',0.5' * 7},{REMARK if k == 2 else ''}\n" for k in range(5))
    (tmp_path / "log.csv").write_text(f'time,{q},"remark\nof the shift"\n{rows}')
    assert len(read_log(tmp_path / "log.csv", load_description("iiwa7_r800")).q) == 5
    write_csv(tmp_path / "scope.csv")
    plain = load_waveform(tmp_path / "scope.csv")
    head, _, rest = (tmp_path / "scope.csv").read_text().partition("\n")
    (tmp_path / "remark.csv").write_text("\n".join([f'{head},"remark\nof the shift"', *rest.splitlines()]) + "\n")
    np.testing.assert_array_equal(load_waveform(tmp_path / "remark.csv").codes, plain.codes)
