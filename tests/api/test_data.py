"""Rows, logs and datasets, and their way through Arrow and pandas."""

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

import acqd
from acqd.extras import install_command
from acqd.models.segments import load_dataset


def test_a_dataset_survives_arrow(folder):
    before = acqd.Dataset("ds")
    table = before.to_arrow()
    assert table.schema.field("P").metadata == {b"unit": b"W"} and str(table.schema.field("time").type.tz) == "UTC"
    after = acqd.Dataset.from_arrow(table, "copy", robot=acqd.Robot("ur10e"), measured="simulated")
    assert (after.robot, after.step_s, after.recordings) == (
        before.robot,
        pytest.approx(before.step_s),
        before.recordings,
    )
    pairs = list(zip(load_dataset(before.path).segments, load_dataset(after.path).segments, strict=True))
    assert pairs
    for old, new in pairs:
        assert (old.recording, old.split) == (new.recording, new.split)
        np.testing.assert_array_equal(old.P, new.P)
        np.testing.assert_array_equal(old.q, new.q)
        assert old.start_s == pytest.approx(new.start_s, abs=1e-6)


def test_a_model_trains_on_a_data_frame(folder):
    pandas = pytest.importorskip("pandas")
    frame = acqd.Dataset("ds").to_pandas().drop(columns=["split", "valid"])
    data = acqd.Dataset.from_pandas(frame, "copy", robot="ur10e", measured="simulated")
    assert isinstance(data.to_pandas(), pandas.DataFrame)
    model = acqd.train(data)
    assert model.path.parent.name == "copy.models"
    assert model.metadata["metrics"]["test"]["rmse"] < 3


def test_tables_that_are_no_dataset_are_named(folder):
    table = acqd.Dataset("ds").to_arrow()
    time = table["time"]
    cases = {
        "lacks P, q6": table.drop_columns(["P", "q6"]),
        "with a time zone": table.set_column(table.column_names.index("time"), "time", time.cast(pa.timestamp("ns"))),
        "holds text, expected numbers": table.append_column("tool", pa.array(["x"] * len(table))),
        "row 6 is not 0.04 s after": pa.concat_tables([table.slice(0, 5), table.slice(8)]),
        "the table has no rows": table.slice(0, 0),
        "expected train, validation or test": table.set_column(1, "split", pa.array(["all"] * len(table))),
        "expected a name of letters": table.set_column(0, "recording", pa.array(["../x"] * len(table))),
    }
    for complaint, wrong in cases.items():
        with pytest.raises(acqd.UserError, match=complaint):
            acqd.Dataset.from_arrow(wrong, "copy", robot="ur10e")
        assert not (folder / "copy").exists(), complaint
    with pytest.raises(acqd.UserError, match="exists"):
        acqd.Dataset.from_arrow(table, "ds", robot="ur10e")
    noted = table.append_column("operator", pa.array(["x"] * len(table)))  # words that nobody reads do not matter
    assert "operator" not in acqd.Dataset.from_arrow(noted, "noted", robot="ur10e").to_arrow().column_names


def test_rows_are_utc_timestamps_with_units(folder):
    rows = acqd.read_rows("power.csv")
    table = rows.to_arrow()
    assert table.schema.field("Vrms").metadata == {b"unit": b"V"}
    np.testing.assert_array_equal(table["time"].cast(pa.int64()).to_numpy(), rows.time_ns)
    pyarrow.parquet.write_table(table, "rows.parquet")
    again = acqd.read_rows("rows.parquet")
    np.testing.assert_array_equal(again.P, rows.P)
    np.testing.assert_array_equal(again.time_ns, rows.time_ns)
    with pytest.raises(acqd.InputError, match="no such file"):
        acqd.read_rows("none.csv")


def test_a_prediction_of_arrays_equals_that_of_the_log(folder):
    log = acqd.read_log("logs/example.csv", "ur10e")
    model = acqd.open_model("model")
    whole = acqd.predict(model, log)
    np.testing.assert_array_equal(whole.P, acqd.predict("model", "logs/example.csv").P)
    cut = log.part(np.arange(200, 500), log.path)
    assert "2 rows at ends in motion are estimated" in acqd.predict(model, cut).note and "motion" not in whole.note
    with pytest.raises(acqd.UserError, match=r"expected \[rows, 6\]"):
        model.predict(np.zeros((10, 7)))
    with pytest.raises(acqd.UserError, match="signals have the shape"):
        model.predict(np.zeros((10, 6)), np.zeros((10, 9)))


def test_a_loop_that_cannot_be_closed_is_named(folder):
    with pytest.raises(acqd.InputError, match="no such folder; acqd train writes bundles"):
        acqd.close_loop("now", "nowhere", "loop")
    with pytest.raises(acqd.UserError, match="no such folder; acqd dataset build makes a dataset"):
        acqd.close_loop("nowhere", "model", "loop")
    with pytest.raises(acqd.UserError, match="not an earlier report"):
        acqd.close_loop("now", "model", "logs")
    assert not (folder / "loop").exists()


def test_a_table_passes_the_checks_of_the_command_line(folder):
    pandas = pytest.importorskip("pandas")
    good = acqd.Dataset("ds").to_pandas().drop(columns=["split", "valid"])
    angles = [f"q{k}" for k in range(1, 7)]
    half = ["train" if k % 2 else "test" for k in range(len(good))]
    cases = {
        "the table has no valid rows": good.assign(valid="False"),
        "column valid: holds 'maybe'": good.assign(valid="maybe"),
        "its rows are in several parts of the split": good.assign(split=half),
        "are these degrees": good.assign(**{name: 600 * good[name] for name in angles}),
        "is the sign inverted": good.assign(P=-good["P"]),
        "is it in kW": good.assign(P=good["P"] / 1000),
        "column time: row 4 has none": good.assign(time=good["time"].mask(good.index == 3)),
        "several columns 'P'": pandas.concat([good, good[["P"]]], axis=1),
        "are rows of several recordings mixed": good.assign(q1=good["q1"].sample(frac=1, random_state=1).to_numpy()),
    }  # fmt: skip
    for complaint, wrong in cases.items():
        with pytest.raises(acqd.UserError, match=complaint):
            acqd.Dataset.from_pandas(wrong, "copy", robot="ur10e", measured="simulated")


def test_repeated_rows_of_a_table_are_bridged_and_counted(folder):
    good = acqd.Dataset("ds").to_arrow().to_pandas().drop(columns=["split", "valid"])
    angles = [f"q{k}" for k in range(1, 7)]
    wrong = np.random.default_rng(0).random(len(good)) < 0.03
    wrong &= good["recording"].eq(good["recording"].shift()).to_numpy()
    repeated = good.copy()
    repeated.loc[wrong, angles] = good[angles].shift().to_numpy()[wrong]
    with pytest.warns(UserWarning, match="hold the pose of the row before repeated"):
        data = acqd.Dataset.from_pandas(repeated, "copy", robot="ur10e", measured="simulated")
    off = np.abs(data.to_pandas()[angles].to_numpy() - good[angles].to_numpy()).max(axis=1)
    before = np.abs(repeated[angles].to_numpy() - good[angles].to_numpy()).max(axis=1)
    assert np.sqrt((off**2).mean()) < 0.3 * np.sqrt((before**2).mean())


def test_axes_in_another_order_are_refused_in_tables_and_by_the_estimator(folder):
    pytest.importorskip("pandas")
    pytest.importorskip("sklearn")
    from acqd.api.estimator import PowerRegressor

    good = acqd.Dataset("ds").to_pandas().query("valid")
    angles = [f"q{k}" for k in range(1, 7)]
    turned = good.rename(columns=dict(zip(angles, [*angles[1:], angles[0]], strict=True)))
    turned = turned[["recording", "time", "P", *angles]]
    remedy = "angles and power of .* do not fit as logged: .*shoulder_pan from column 2"
    with pytest.raises(acqd.UserError, match=remedy):
        acqd.Dataset.from_pandas(turned, "copy", robot="ur10e", measured="simulated")
    with pytest.raises(acqd.UserError, match=remedy):
        PowerRegressor(robot="ur10e").fit(turned[angles], turned["P"], groups=turned["recording"])


def test_rows_of_a_database_or_a_text_need_no_library(tmp_path):
    """In a process of its own: this one has imported everything."""
    (tmp_path / "rows.csv").write_text("time,P\n1.7e9,1\n1700000001,2\n1700000002,1\n1700000003,3\n")
    (tmp_path / "rows.parquet").touch()
    rows = "INSERT INTO power VALUES ('a', 'L1', 'b', ?, '2026-01-01T00:00:00Z', ?, 230, 1, ?, 0, 1, 50, 0, '[]', 1)"
    code = f"""
import sqlite3, sys
for name in ("pyarrow", "scipy", "matplotlib", "jinja2"):
    sys.modules[name] = None
import acqd
from acqd.storage.database import open_database
file = {str(tmp_path / "rows.sqlite")!r}
open_database(file).dispose()
with sqlite3.connect(file) as database:
    database.executemany({rows!r}, [(k, 133480224000000000 + 400000 * k, 100 + k) for k in range(5)])
print(len(acqd.read_rows(file)), len(acqd.read_rows({str(tmp_path / "rows.csv")!r})))
try:
    acqd.read_rows({str(tmp_path / "rows.parquet")!r})
except acqd.UserError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=False)
    asked = f"{tmp_path / 'rows.parquet'}: Parquet needs pyarrow: {install_command('parquet')}"
    assert done.stdout.splitlines() == ["5 4", asked], done.stderr
