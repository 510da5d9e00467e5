"""Tables as robots and their users write them."""

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.errors import InputError
from acqd.robot.table import read_table


def table_of(tmp_path, text, name="x.csv", **options):
    path = tmp_path / name
    path.write_bytes(text.encode())
    return read_table(path, **options)


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r\r\n"])
def test_separators_line_ends_and_blank_lines(tmp_path, separator, end):
    lines = ["", separator.join(("a", "b")), separator.join(("1", "-2.5")), "", separator.join(("3e-1", "4")), "", ""]
    table = table_of(tmp_path, end.join(lines))
    assert table.header == ["a", "b"]
    np.testing.assert_array_equal(table.values, [[1, -2.5], [0.3, 4]])
    assert [table.line(row) for row in (0, 1)] == [3, 5]


@given(st.lists(st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)), min_size=1, max_size=8))
@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("header", ["a{}b\n", ""])
def test_decimal_commas_are_read_where_other_marks_separate(tmp_path_factory, separator, header, rows):
    cells = [separator.join(repr(value).replace(".", ",") for value in row) for row in rows]
    text = header.format(separator) + "\n".join(cells)
    table = table_of(tmp_path_factory.mktemp("t"), text)
    np.testing.assert_array_equal(table.values, rows)


@pytest.mark.parametrize("title", ["Table", "Dziennik ramienia - 2026"])
def test_a_title_before_two_columns_is_no_header(tmp_path, title):
    table = table_of(tmp_path, f"{title}\ntime,q1\n1,2\n3,4\n")
    assert table.header == ["time", "q1"] and len(table.values) == 2


def test_decimal_commas_between_commas_are_refused(tmp_path):
    with pytest.raises(InputError, match="row 2 has 4 columns, the first line 2; are commas decimal marks and sep"):
        table_of(tmp_path, "a,b\n0,1,0,2\n")
    table = table_of(tmp_path, "when;a\n22.11.2026;1.234,5\n")  # a date, and a number with two marks: no number
    assert np.isnan(table.values).all()


def test_a_share_of_broken_rows_may_be_allowed(tmp_path):
    text = "a,b\n" + "1,2\n" * 150 + "1\n"
    with pytest.raises(InputError, match="row 152 has 1 columns, the first line 2; is it cut off"):
        table_of(tmp_path, text)
    table = table_of(tmp_path, text, broken_share=0.01)
    assert list(table.broken) == [150] and np.isnan(table.values[150]).all() and np.isfinite(table.values[:150]).all()


def test_parquet_with_integers_stamps_text_and_nulls(tmp_path):
    path = tmp_path / "x.parquet"
    stamps = pyarrow.array([1_000_000_000_500_000, None], pyarrow.timestamp("us", "UTC"))
    columns = {"t": stamps, "n": [1, None], "on": [True, False], "x": pyarrow.array([1.5, 2], pyarrow.float32())}
    pyarrow.parquet.write_table(pyarrow.table({**columns, "name": ["a", "b"]}), path)
    table = read_table(path)
    assert table.header == ["t", "n", "on", "x", "name"]
    np.testing.assert_array_equal(table.values, [[1e9 + 0.5, 1, 1, 1.5, np.nan], [np.nan, np.nan, 0, 2, np.nan]])


def test_broken_parquet_is_refused(tmp_path):
    (tmp_path / "a.parquet").write_bytes(b"PAR1 and nothing else")
    with pytest.raises(InputError, match="is not a Parquet file"):
        read_table(tmp_path / "a.parquet")
    with pytest.raises(InputError, match="is not a Parquet file"):
        read_table(tmp_path / "none.parquet")
    pyarrow.parquet.write_table(pyarrow.table({"a": pyarrow.array([], pyarrow.float64())}), tmp_path / "e.parquet")
    with pytest.raises(InputError, match="has no rows"):
        read_table(tmp_path / "e.parquet")


def test_a_small_file_of_very_many_equal_rows_is_refused_before_it_is_read(tmp_path, monkeypatch):
    """Equal values take hardly a byte; the limit is lower here."""
    monkeypatch.setattr("acqd.parquet_size.MOST_CELLS", 10_000_000)
    path, rows = tmp_path / "a.parquet", np.zeros(3_000_001, dtype=bool)
    pyarrow.parquet.write_table(pyarrow.table(dict.fromkeys(("time", "q1", "q2", "q3"), rows)), path)
    assert path.stat().st_size < 200_000
    with pytest.raises(InputError, match=r"3000001 rows of 4 columns, 1\.2 times what is read at once"):
        read_table(path)


def test_labels_are_names_or_numbers_as_text(tmp_path):
    words = {"program"}
    path = tmp_path / "a.csv"
    path.write_text("time;program;q1\n0;Fügen 2;0,5\n1;12,0;0,6\n2;;0,7\n3;7;\n")
    table = read_table(path, words=words)
    assert table.texts(1).tolist() == ["Fügen 2", "12", "", "7"]
    assert table.values[:3, 2].tolist() == [0.5, 0.6, 0.7]
    path.write_text("time,program,q1\n0,3,0.5\n1,nan,0.6\n")
    assert read_table(path, words=words).texts(1).tolist() == read_table(path).texts(1).tolist() == ["3", ""]
    columns = {"time": [0.0, 1.0, 2.0], "program": ["pick", None, "4.0"], "q1": [0.1, 0.2, 0.3]}
    pyarrow.parquet.write_table(pyarrow.table(columns), tmp_path / "a.parquet")
    table = read_table(tmp_path / "a.parquet", words=words)
    assert table.texts(1).tolist() == ["pick", "", "4"] and np.isnan(table.values[0, 1])


def test_separators_in_quotes_are_part_of_a_label(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text('"time","q1","step"\n0,1,"pick, place"\n1,2,"""a""; b"\n2,3,5" pipe\n')
    table = read_table(path, words=("step",))
    assert table.header == ["time", "q1", "step"] and list(table.texts(2)) == ["pick, place", 'a"; b', '5" pipe']
    np.testing.assert_array_equal(table.values[:, 1], [1, 2, 3])
