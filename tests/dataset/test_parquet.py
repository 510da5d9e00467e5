"""Parquet without a library: other readers read what is written, and damaged files are refused."""

import random

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from acqd.dataset.parquet import OtherWriterError, read_parquet, write_parquet
from acqd.dataset.parquet.thrift import I32, Reader, encoded
from acqd.dataset.schema import read_columns, write_columns
from acqd.errors import InputError, UserError


def columns(rows):
    rng = np.random.default_rng(rows)
    return {
        "time": (10**18 + 40_000_000 * np.arange(rows)).astype("datetime64[ns]"),
        "P": np.where(rng.random(rows) < 0.1, np.nan, rng.normal(200, 5, rows)),
        "valid": rng.random(rows) > 0.2,
        "program": np.array([f"Schweißen {k // 5}" if k % 7 else "" for k in range(rows)], dtype=object),
        "count": np.arange(rows) - 3,
    }


@pytest.mark.parametrize("rows", [0, 1, 7, 8, 9, 2600])
def test_columns_come_back_as_they_were_and_pyarrow_reads_the_same(tmp_path, monkeypatch, rows):
    monkeypatch.setattr("acqd.dataset.parquet.write._GROUP_ROWS", 1000)
    written, path = columns(rows), tmp_path / "a.parquet"
    write_parquet(path, written, {"P": "W"})
    back, table = read_parquet(path), pyarrow.parquet.read_table(path)
    assert list(back) == table.column_names == list(written)
    assert table.schema.field("time").type == pa.timestamp("ns", "UTC")
    assert table.schema.metadata == {b"units": b'{"P":"W"}'}
    for name, values in written.items():
        assert back[name].dtype == values.dtype
        np.testing.assert_array_equal(back[name], values)
        np.testing.assert_array_equal(table[name].to_numpy(), values)


@pytest.mark.parametrize("distinct", [256, 257, 70_000])
def test_labels_are_numbered_by_as_many_bits_as_they_need(tmp_path, distinct):
    texts = np.array([f"{k % distinct}" for k in range(70_003)], dtype=object)
    write_parquet(tmp_path / "a.parquet", {"program": texts})
    assert (read_parquet(tmp_path / "a.parquet")["program"] == texts).all()
    assert pyarrow.parquet.read_table(tmp_path / "a.parquet")["program"].to_pylist() == texts.tolist()


def test_a_damaged_file_is_refused_or_read_as_it_was(tmp_path):
    """Cut off, with bytes changed anywhere or in the footer, or without some."""
    written, path, rng = columns(300), tmp_path / "a.parquet", random.Random(1)
    write_parquet(path, written)
    good, refused = path.read_bytes(), 0
    for k in range(400):
        copy = bytearray(good)
        if k % 4 == 0:
            del copy[rng.randrange(len(copy)) :]
        elif k % 4 == 1:
            start = rng.randrange(len(copy))
            del copy[start : start + rng.randint(1, 50)]
        else:
            first = 0 if k % 4 == 2 else len(copy) - 500
            for _ in range(rng.randint(1, 4)):
                copy[rng.randrange(first, len(copy))] = rng.randrange(256)
        path.write_bytes(copy)
        try:
            back = read_parquet(path)
        except (ValueError, OtherWriterError, InputError):
            refused += 1
        else:
            same = [np.array_equal(back[name], written[name]) for name in back.keys() & written.keys() - {"P"}]
            assert len(back) == len(written) and all(same)
    assert refused > 300


def test_a_recording_of_another_version_is_read_by_pyarrow_or_asks_for_it(tmp_path, monkeypatch):
    path, stamps = tmp_path / "a.parquet", np.arange(3) * 40_000_000
    old = {
        "time": pa.array(stamps).cast(pa.timestamp("ns", "UTC")),
        "P": [1.0, 2.0, 3.0],
        "program": [1.0, 1.0, np.nan],
    }
    pyarrow.parquet.write_table(pa.table(old), path)
    read = read_columns(path)
    assert read["time_ns"].tolist() == stamps.tolist() and read["program"].tolist() == ["1", "1", ""]
    monkeypatch.setattr("acqd.extras.find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"needs pyarrow: .*'acqd\[parquet\]'"):
        read_columns(path)
    write_columns(path, stamps, {"P": np.ones(3)})
    assert read_columns(path)["time_ns"].tolist() == stamps.tolist()


def test_structures_of_thrift_come_back_and_damaged_ones_have_an_end():
    fields = {1: I32(-5), 2: 2**40, 3: True, 4: "text", 5: [{1: 1}, {1: 2}], 6: list(range(20)), 40: {8: {}}, 41: False}
    data = encoded(fields)
    assert Reader(data).structure() == {**fields, 4: b"text"}
    with pytest.raises(ValueError, match="within structures"):
        Reader(b"\x1c" * 100).structure()
    for end in range(len(data)):
        with pytest.raises(ValueError, match=r"without an end|longer than"):
            Reader(data[:end]).structure()
