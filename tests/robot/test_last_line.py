"""The last line of a table without an end: whole, or cut off inside its last value."""

import pytest

from acqd.errors import InputError
from acqd.robot.last_line import is_cut_off
from acqd.robot.table import read_table

FIXED = [["1.00", f"{k / 7:.3f}"] for k in range(50)]
VARYING = [["1", repr(k / 7)] for k in range(1, 300)]


@pytest.mark.parametrize(
    ("others", "last", "cut"),
    [
        (FIXED, ["1.00", "0.123"], False),
        (FIXED, ["1.00", "0.12"], True),
        (FIXED, ["1.00", "12"], True),
        (FIXED, ["1.00", "-"], True),
        (FIXED, ["1.00"], True),
        (FIXED[:5], ["1.00", "0.12"], False),  # too few rows tell
        (VARYING, ["1", "0.8571428571428571"], False),
        (VARYING, ["1", "2.0"], False),  # as short as others
        (VARYING, ["1", "0.3"], False),
        (VARYING, ["1", "0"], False),
        ([["1", "2.50e-03"]] * 20, ["1", "2.50e-0"], True),
        ([["1", "2.50e-03"]] * 20, ["1", "2.50e-03"], False),
        ([["1", str(k)] for k in range(100, 400)], ["1", "39"], False),  # integers may be shorter
        *((FIXED, ["1.00", cell], False) for cell in ("", "nan", "NaN", "-inf", "null", "n/a", "off", "0", "1")),
        ([*FIXED, ["1.00", "nan"]], ["1.00", "0.1"], True),
        ([*FIXED, ["1.00", "0"]], ["1.00", "0.1"], False),
        ([["1", "35.1"]] * 90, ["1", "35"], False),
        ([["1", "35.25"]] * 90, ["1", "35.2"], True),
        ([["1", "35.25"]] * 40, ["1", "35.2"], False),
        ([["1", "0.123456"]] * 20, ["1", "1e-05"], False),  # no zero fills up: 0.12 may be whole
        (FIXED, ["1.00", "0.123\0\0"], True),
        ([["1", str(k)] for k in range(300)], ["1", "299"], False),
        ([["1", "RUNNING"], ["1", "STOPPED"]], ["1", "RUNN"], False),
        ([["1", "RUNNING"], ["1", "STOPPED"]], ["1", "STOPPED"], False),
        ([["1", ""], ["1", "RUN"]], ["1", "R"], False),
        ([["1", "2.5"], ["1", "2.5", "x"], ["1", "2.5"]], ["1", "2.5"], False),
    ],
)
def test_a_part_of_a_line_is_known_by_the_lines_before(others, last, cut):
    assert is_cut_off(last, others) == cut


def text(rows, end="\n"):
    return "time,q1\n" + "\n".join(f"{0.01 * k:.2f},{k / 7:.4f}" for k in range(rows)) + end


@pytest.mark.parametrize(
    ("end", "rows"), [("\n", 40), ("", 40), ("\n0.40,5.7", 40), ("\n0.40,5.7143", 41), ("\n0.4", 40)]
)
def test_a_cut_line_is_left_out_and_said(tmp_path, end, rows):
    path = tmp_path / "log.csv"
    path.write_text(text(40, end))
    table = read_table(path, 0.01)
    assert len(table.values) == rows
    assert bool(table.note) == (rows == 40 and end.startswith("\n0"))
    if end == "\n0.4":
        with pytest.raises(InputError, match="its last line is cut off"):
            read_table(path)
    elif table.note:  # of a table that people write, too
        assert len(read_table(path).values) == 41


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_text_of_other_encodings_is_read(tmp_path, encoding):
    path = tmp_path / "log.csv"
    path.write_bytes(text(40).encode(encoding))
    assert read_table(path).values.shape == (40, 2)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-32"])
def test_text_that_ends_within_a_character_is_read(tmp_path, encoding):
    path = tmp_path / "log.csv"
    path.write_bytes(text(40).encode(encoding)[:-1])
    assert read_table(path, 0.01).values.shape == (40, 2)


def test_separators_in_quotes_are_no_cells(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,q1,name\n" + '0.1,2,"a,b"\n' * 20 + "0.2,2,a")
    assert read_table(path).values.shape == (21, 3)


def test_western_text_is_read_and_bytes_that_are_no_text_are_not(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"time,q1,Gr\xf6\xdfe\n" + b"0.01,1.5,2\n" * 10)
    assert read_table(path).values.shape == (10, 3)
    path.write_bytes(b"time,q1\n\x01\x02\xff\xfe\n")
    with pytest.raises(InputError, match="no UTF-8 text"):
        read_table(path)


@pytest.mark.parametrize(
    ("head", "remedy"), [(b"\x28\xb5\x2f\xfd", "unzstd"), (b"\xfd7zXZ", "unxz"), (b"ARROW1", "CSV or")]
)
def test_what_is_no_table_names_the_remedy(tmp_path, head, remedy):
    path = tmp_path / "log.csv"
    path.write_bytes(head + bytes(50))
    with pytest.raises(InputError, match=remedy):
        read_table(path)
