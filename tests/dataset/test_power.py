"""Power rows from files of any kind."""

import gzip
import json

import numpy as np
import pyarrow.parquet
import pytest

from acqd.dataset.config import BuildConfig
from acqd.dataset.log_power import require_drawn, small_power
from acqd.dataset.power import open_power
from acqd.dataset.write import power_provenance
from acqd.errors import InputError, UserError


def rows(count=200):
    t = np.arange(count) * 0.04
    return t, 150 + 20 * np.sin(t)


@pytest.mark.parametrize("form", ["rfc3339", "s", "ms", "ns", "filetime", "jsonl", "parquet"])
def test_rows_are_read_from_any_file_with_any_clock(tmp_path, form):
    t, P = rows()
    base = 1_626_163_200
    clock = {
        "rfc3339": [f"2021-07-13T08:00:{s:09.6f}Z" for s in t],
        "s": [f"{base + s:.6f}" for s in t],
        "ms": [str(round((base + s) * 1000)) for s in t],
        "ns": [str(base * 10**9 + round(s * 1e9)) for s in t],
        "filetime": [str((base + 11_644_473_600) * 10**7 + round(s * 1e7)) for s in t],
    }.get(form, [f"2021-07-13T08:00:{s:09.6f}Z" for s in t])
    name = "filetime" if form == "filetime" else "time"
    if form == "jsonl":
        path = tmp_path / "p.jsonl"
        path.write_text(
            "".join(json.dumps({"time": a, "P": b, "flags": []}) + "\n" for a, b in zip(clock, P, strict=True))
        )
    elif form == "parquet":
        path = tmp_path / "p.parquet"
        pyarrow.parquet.write_table(pyarrow.table({"time": clock, "P": P}), path)
    else:
        path = tmp_path / "p.csv"
        path.write_text("\n".join([f"{name},P", *(f"{a},{b}" for a, b in zip(clock, P, strict=True)), ""]))
    stream = open_power(str(path), None, None)
    np.testing.assert_allclose(stream.time_ns * 1e-9 - base, t, atol=1e-6)
    np.testing.assert_allclose(stream.P, P)
    assert stream.window_ns == 40_000_000


def test_duplicates_and_disorder_are_put_right_and_flagged_rows_are_left_out(tmp_path):
    t, P = rows()
    order = [5, 4, *range(200), 7, 7]
    flags = {9: '"[""gap""]"'}
    lines = [f"{1_626_163_200 + t[k]:.3f},{P[k]},{flags.get(k, '[]')}" for k in order]
    (tmp_path / "p.csv").write_text("\n".join(["time,P,flags", *lines, ""]))
    stream = open_power(str(tmp_path / "p.csv"), None, None)
    assert len(stream.time_ns) == 200 and stream.dropped == 4
    assert (np.diff(stream.time_ns) > 0).all()
    assert np.flatnonzero(np.isnan(stream.P)).tolist() == [9]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("time,power\n1,2\n2,3\n3,4\n", "needs the columns time .or filetime. and P; it has time, power"),
        ("time,P\nsoon,1\nlater,2\nnever,3\n", "time 'soon' is neither RFC 3339 nor a number"),
        ("time,P\n1,5\n2,5\n3,5\n4,5\n", "P is constant or missing"),
        ("time,P\n1,5\n", "fewer than three rows"),
        ("time,P,device\n1,5,a\n2,6,b\n3,6,a\n", "holds several devices; choose one with --device: a, b"),
    ],
)
def test_rows_that_cannot_be_used_are_named(tmp_path, text, complaint):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(UserError, match=complaint):
        open_power(str(tmp_path / "p.csv"), None, None)


def test_channels_that_come_one_after_the_other_are_told_apart(tmp_path, monkeypatch):
    monkeypatch.setattr("acqd.robot.table_text._BLOCK_BYTES", 5000)
    monkeypatch.setattr("acqd.dataset.power_text.BLOCK_ROWS", 1000)
    rows_ = [
        f"{1_626_163_200 + 0.04 * k:.3f},{channel},{P + k % 7}"
        for channel, P in (("L1", 50), ("total", 150))
        for k in range(3500)
    ]
    (tmp_path / "p.csv").write_text("\n".join(["time,channel,P", *rows_, ""]))
    stream = open_power(str(tmp_path / "p.csv"), None, None)
    assert len(stream.P) == 3500 and stream.P.min() == 150
    assert open_power(str(tmp_path / "p.csv"), None, "L1").P.max() == 56


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("a.parquet", "", "is not a Parquet file"),
        ("a.jsonl", '{"time": null, "P": 1}\n', "row 1 has no time"),
        ("a.jsonl", "[1, 2]\n", "line 1 is not a JSON object"),
        ("a.csv", "filetime,P\n,1\n", "has no time"),
        ("a.csv", "filetime,P\nx,1\n", "column filetime"),
        ("a.sqlite", "", "is empty"),
    ],
)
def test_broken_power_files_are_named(tmp_path, name, text, expected):
    (tmp_path / name).write_text(text)
    with pytest.raises(UserError, match=expected):
        open_power(str(tmp_path / name), None, None)
    assert (tmp_path / name).read_text() == text


def test_a_manifest_holds_no_password(tmp_path):
    t, P = rows()
    path = tmp_path / "power.csv"
    path.write_text("time,P\n" + "".join(f"{1_626_163_200 + s:.6f},{p}\n" for s, p in zip(t, P, strict=True)))
    config = BuildConfig("postgresql://reader:hush@db:5432/acqd", tmp_path, tmp_path / "ds", "ur10e")
    assert power_provenance(config, [open_power(str(path), None, None)])["origin"] == "postgresql://db:5432/acqd"


@pytest.mark.parametrize("decimal", [",", "."])
def test_a_file_with_semicolons_is_read(tmp_path, decimal):
    t, P = rows()
    path = tmp_path / "p.csv"
    lines = [f"{1_626_163_200 + a:.3f};{b:.6f};230.5".replace(".", decimal) for a, b in zip(t, P, strict=True)]
    path.write_text("\n".join(["time;P;Vrms", *lines, ""]))
    stream = open_power(str(path), None, None)
    np.testing.assert_allclose(stream.time_ns * 1e-9 - 1_626_163_200, t, atol=1e-6)
    np.testing.assert_allclose(stream.P, P, atol=1e-5)
    assert set(stream.Vrms) == {230.5}


def test_power_that_flows_out_of_the_robot_is_refused_and_kilowatts_are_noted(tmp_path):
    t, P = rows()
    path = tmp_path / "p.csv"

    def written(factor):
        path.write_text(
            "\n".join(["time,P", *(f"{1.6e9 + a:.3f},{b * factor}" for a, b in zip(t, P, strict=True)), ""])
        )
        return open_power(str(path), None, None)

    with pytest.raises(UserError, match=r"p\.csv: its power is -1.* W on average; .*current transformer"):
        require_drawn(written(-1.0))
    require_drawn(written(1.0))
    assert not small_power([written(1.0)])
    assert "is it in kW?" in small_power([written(0.001)])[0]


@pytest.mark.parametrize("digits", [0, 1])
def test_rows_that_share_a_stamp_are_put_at_their_times_and_the_digits_are_named(tmp_path, digits):
    t = 1_626_163_200 + 0.01 * np.arange(20_000)
    P = 150 + 20 * np.sin(t) + np.random.default_rng(0).normal(0, 0.1, len(t))
    lines = [f"{time:.{digits}f},{power:.4f}" for time, power in zip(t, P, strict=True)]
    (tmp_path / "p.csv").write_text("\n".join(["time,P", *lines, ""]))
    stream = open_power(str(tmp_path / "p.csv"), None, None)
    assert len(stream.time_ns) == len(t) and stream.dropped == 0 and stream.window_ns == 10_000_000
    assert np.abs(stream.time_ns * 1e-9 - t).max() < stream.stamp_error_s + 0.03
    assert "write times with three decimals" in stream.notes[0]


def test_irregular_rows_that_share_a_stamp_are_refused(tmp_path):
    t = 1_626_163_200 + np.cumsum(np.random.default_rng(0).exponential(0.01, 5000))
    lines = [f"{time:.1f},{power:.4f}" for time, power in zip(t, np.sin(t), strict=True)]
    (tmp_path / "p.csv").write_text("\n".join(["time,P", *lines, ""]))
    with pytest.raises(UserError, match="too few digits"):
        open_power(str(tmp_path / "p.csv"), None, None)


@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
def test_a_wall_clock_at_the_end_of_summer_time_loses_no_row(tmp_path, zone):
    utc = np.arange(np.datetime64("2026-10-25T00:00:00"), np.datetime64("2026-10-25T02:00:00"), np.timedelta64(2, "s"))
    wall = utc + np.where(utc < np.datetime64("2026-10-25T01:00:00"), 2, 1) * np.timedelta64(1, "h")
    lines = [f"{str(time).replace('T', ' ')},{50 + k % 7}" for k, time in enumerate(wall)]
    (tmp_path / "p.csv").write_text("\n".join(["time,P", *lines, ""]))
    stream = open_power(str(tmp_path / "p.csv"), None, None, zone=zone)
    assert len(stream.time_ns) == 3600 and (np.diff(stream.time_ns) == 2_000_000_000).all()
    assert bool(stream.notes) == (zone is None)
    unknown_s = 2 * 3600 if zone is None else 0
    assert stream.time_ns[0] // 1_000_000_000 == utc[0].astype("int64") + unknown_s


def test_an_unknown_zone_is_named(tmp_path):
    (tmp_path / "p.csv").write_text("time,P\n2026-10-25 02:00:00,1\n")
    with pytest.raises(UserError, match="zone 'Mars' is unknown"):
        open_power(str(tmp_path / "p.csv"), None, None, zone="Mars")


ROWS = "time,P\n" + "".join(f"{1_700_000_000 + 0.04 * k:.2f},{100 + 9 * np.sin(0.3 * k):.3f}\n" for k in range(200))


@pytest.mark.parametrize(
    ("content", "rows", "noted"),
    [
        (ROWS.replace(",", "\t").encode(), 200, 0),
        (ROWS.encode("utf-16"), 200, 0),
        (ROWS[:-9].encode(), 199, 1),  # the recorder was stopped within a line
        (b"# 1\n# 2\n" + ROWS[:-4].encode(), 199, 1),
        (b"\xef\xbb\xbf# W of P\n\n" + ROWS.encode(), 200, 0),
        (b"# P, Q and S\n" + ROWS.encode(), 200, 0),
        (b"# time,P of L1,P\n" + ROWS.encode(), 200, 0),
        (ROWS.replace("\n", "\r").encode(), 200, 0),
        (ROWS.encode() + b"1700000100,0", 201, 0),
        (ROWS.replace("\n", ',"a,b"\n').replace('P,"a,b"', "P,flags").encode() + b"1700000100,5,a", 201, 0),
        (ROWS.replace("\n", ',"a,b"\n').replace('P,"a,b"', "P,flags").encode() + b'1700000100,5,"a', 200, 1),
        (ROWS.encode() + bytes(500), 200, 1),  # the file system had kept room for more
    ],
)
def test_tabs_other_encodings_and_a_last_line_that_is_cut_off_are_read(tmp_path, content, rows, noted):
    (tmp_path / "rows.csv").write_bytes(content)
    stream = open_power(str(tmp_path / "rows.csv"), None, None)
    assert len(stream.P) == rows
    cut = [note for note in stream.notes if "its last line is cut off" in note]
    assert len(cut) == noted


@pytest.mark.parametrize(("end", "noted"), [('{"time":17000', 1), ("\n \n", 0)])
def test_a_last_line_of_json_that_is_cut_off_and_blank_ones_are_no_rows(tmp_path, end, noted):
    rows = [row.split(",") for row in ROWS.splitlines()[1:]]
    text = "".join(f'{{"time":{time},"P":{P}}}\n' for time, P in rows)
    (tmp_path / "rows.jsonl").write_text(text + end)
    stream = open_power(str(tmp_path / "rows.jsonl"), None, None)
    assert len(stream.P) == 200 and sum("its last line is cut off" in note for note in stream.notes) == noted


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (gzip.compress(ROWS.encode()), "is compressed; unpack it first: gunzip FILE"),
        (
            ROWS.replace("00.40,", "00.40,1,").encode(),
            "row 12 has 3 columns, the header 2: is it cut off, or are commas",
        ),
        (ROWS.encode() + b"time,P,Hz\n1700000100,5,50\n", "row 202 has 3 columns, the header 2"),
        (ROWS.replace("\n", ",5\n").replace("P,5", "P").encode(), "row 2 has 3 columns, .*separate columns by ;"),
        (ROWS.replace("00.40,", "00.40 ").encode() + b"1", "row 12 has 1 columns, the header 2"),
        (b"\n  ", "has no rows; expected a header with the columns time"),
        (b"# c\n#" + ROWS.encode(), "its header is a comment"),
        (ROWS.encode() + b"1700000100\n", "row 202 has 1 columns, the header 2"),
        (ROWS.encode() + b"1700000100,---\n", "column P holds '---': .* empty cells for missing values"),
        (ROWS.replace("\n", " W\n").replace("P W", "P").encode(), "column P holds '.* W': expected numbers without"),
        (
            b"time,P\n" + b"".join(b"%d,%d\n" % (1_700_000_000 + k, k) for k in range(150)),
            "P never falls: is it the reg",
        ),
    ],
)
def test_what_is_no_table_of_power_is_refused_with_the_remedy(tmp_path, content, line):
    (tmp_path / "rows.csv").write_bytes(content)
    with pytest.raises(InputError, match=line):
        open_power(str(tmp_path / "rows.csv"), None, None)


def test_phases_without_a_total_are_not_taken_for_one(tmp_path):
    path = tmp_path / "p.csv"
    lines = [f"{1.7e9 + 0.04 * k:.2f},{channel},{50 + k}" for k in range(60) for channel in ("L1", "L2", "L3")]
    path.write_text("\n".join(["time,channel,P", *lines, ""]))
    with pytest.raises(UserError, match="has no total, but L1, L2, L3: choose one with --channel"):
        open_power(str(path), None, None)
    assert len(open_power(str(path), None, "L2").P) == 60


@pytest.mark.parametrize(
    ("head", "said"), [("# meter\ntime,P", ""), ("sep=,\ntime,P", ""), ("# time,P", "is a comment")]
)
def test_lines_before_the_header_are_no_rows(tmp_path, head, said):
    path = tmp_path / "p.csv"
    path.write_text("\n".join([head, *(f"{1.7e9 + 0.04 * k:.2f},{50 + k % 7}.25" for k in range(60)), ""]))
    if said:
        with pytest.raises(UserError, match=said):
            open_power(str(path), None, None)
    else:
        assert len(open_power(str(path), None, None).P) == 60


@pytest.mark.parametrize(("cut", "rows"), [(0, 60), (1, 60), (2, 59), (9, 59)])
def test_a_line_that_is_cut_inside_its_last_value_is_no_row(tmp_path, cut, rows):
    path = tmp_path / "p.csv"
    text = "\n".join(["time,P", *(f"{1.7e9 + 0.04 * k:.2f},{50 + k % 7}.25" for k in range(60)), ""])
    path.write_text(text[: len(text) - cut])
    stream = open_power(str(path), None, None)
    assert len(stream.P) == rows and any("cut off" in note for note in stream.notes) == (rows == 59)


@pytest.mark.parametrize(
    ("first", "remedy"),
    [
        (134_139_736_000_000_000, "name the column filetime"),
        (638_356_000_000_000_000, "ticks of .NET.* write RFC 3339"),
    ],
)
def test_times_of_windows_under_the_name_of_a_unix_time_are_named(tmp_path, first, remedy):
    path = tmp_path / "p.csv"
    path.write_text("\n".join(["time,P", *(f"{first + 400_000 * k},{50 + k}" for k in range(60)), ""]))
    with pytest.raises(UserError, match=remedy):
        open_power(str(path), None, None)


def test_json_is_named_as_such_with_what_can_be_read(tmp_path):
    path = tmp_path / "p.dat"
    path.write_text('{"time": 1.0, "P": 2.0}\n')
    with pytest.raises(UserError, match=r"is JSON; write its table as CSV; expected .* \.jsonl or"):
        open_power(str(path), None, None)


def test_a_compressed_file_is_named_as_one_whatever_it_is_called(tmp_path):
    path = tmp_path / "p.csv.gz"
    path.write_bytes(gzip.compress(ROWS.encode()))
    with pytest.raises(UserError, match="is compressed; unpack it first"):
        open_power(str(path), None, None)


@pytest.mark.parametrize(("device", "channel", "option"), [("hall-3", None, "device"), (None, "L1", "channel")])
def test_a_choice_among_rows_without_that_column_is_refused(tmp_path, device, channel, option):
    (tmp_path / "p.csv").write_text(ROWS)
    with pytest.raises(UserError, match=f"has no column {option}; leave --{option} out"):
        open_power(str(tmp_path / "p.csv"), device, channel)


@pytest.mark.parametrize(
    ("text", "P"),
    [
        ("time , P , Vrms\n1.7e9, 1 ,230\n1700000001 ,2,NA\n1700000002,3.5,\n", [1, 2, 3.5]),
        (
            "time;P\n2026-01-01 00:00:00,0;1,5\n2026-01-01 00:00:01;NULL\n2026-01-01 00:00:02;3\n2026-01-01 00:00:03;4",
            [1.5, np.nan, 3, 4],
        ),
        ('"time","P","device"\n"1700000000","1","a,b"\n1700000001,2,"a,b"\n1700000002,1,"a,b"\n', [1, 2, 1]),
    ],
)
def test_cells_are_read_as_programs_write_them(tmp_path, text, P):
    (tmp_path / "p.csv").write_text(text)
    np.testing.assert_array_equal(open_power(str(tmp_path / "p.csv"), None, None).P, P)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("p.csv", "time,P,P\n1,2,3\n", "has several columns 'P'"),
        ("p.jsonl", '{"time": 1, "P": [1]}\n', r"data row 1: column P holds '\[1\]'"),
        ("p.jsonl", '{"time": [1, 2], "P": 1}\n', r"data row 1: time .\[1, 2\]. is no number"),
        ("p.csv", "time;P\n1;1.234,5\n", "column P holds '1.234,5'"),
        ("p.csv", "time,P\n1,2\n\0\0\0\0,3\n", "data row 2: time .*is no number"),
        ("p.csv", "\x02\x1f,P\n1,2\n", "is no text"),
        (
            "p.csv",
            "time,P\n2026-01-01T00:00:00Z,1\n2026-01-01T00:00:01,2\n",
            "data row 2: its time has no zone, those of the rows before have one",
        ),
        ("p.csv", "time,P\n" + "".join(f"{60 + k % 7},{1.7e9 + k:.0f}\n" for k in range(200)), "columns exchanged"),
    ],
)
def test_cells_that_are_no_numbers_are_named(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=said):
        open_power(str(tmp_path / name), None, None)


def test_a_whole_first_second_in_json_cuts_no_later_time(tmp_path):
    """As JavaScript writes numbers: without a point where they are whole."""
    times = [1_700_000_000, 1_700_000_000.25, 1_700_000_000.5, 1_700_000_000.75, 1_700_000_001]
    rows = [f'{{"time": {time}, "P": {k}}}\n' for k, time in enumerate(times)]
    (tmp_path / "p.jsonl").write_text("".join(rows))
    assert np.diff(open_power(str(tmp_path / "p.jsonl"), None, None).time_ns).tolist() == [250_000_000] * 4


def test_nanoseconds_in_text_keep_their_digits(tmp_path):
    times = [1_700_000_000_123_456_789 + 40_000_001 * k for k in range(4)]
    (tmp_path / "p.csv").write_text("time,P\n" + "".join(f"{time},{k}\n" for k, time in enumerate(times)))
    assert open_power(str(tmp_path / "p.csv"), None, None).time_ns.tolist() == times


def test_a_device_that_only_later_rows_of_json_name_is_another_one(tmp_path, monkeypatch):
    monkeypatch.setattr("acqd.dataset.power_text.BLOCK_ROWS", 2)
    rows = ['{"time": 1, "P": 1}\n', '{"time": 2, "P": 2}\n', '{"time": 3, "P": 1, "device": "b"}\n']
    (tmp_path / "p.jsonl").write_text("".join(rows))
    with pytest.raises(UserError, match="holds several devices"):
        open_power(str(tmp_path / "p.jsonl"), None, None)


@pytest.mark.parametrize(("name", "said"), [("none.dat", "no such file"), ("folder", "is a folder")])
def test_a_place_that_is_no_file_is_named(tmp_path, name, said):
    (tmp_path / "folder").mkdir()
    with pytest.raises(UserError, match=f"{said}; expected an SQL URL"):
        open_power(str(tmp_path / name), None, None)


@pytest.mark.parametrize(("end", "used"), [("Z", False), ("", True)])
def test_a_zone_that_is_not_needed_is_said(tmp_path, end, used):
    rows = "".join(f"2026-01-01T00:00:{k:02d}{end},{k % 5}\n" for k in range(30))
    (tmp_path / "p.csv").write_text(f"time,P\n{rows}")
    notes = open_power(str(tmp_path / "p.csv"), None, None, zone="Europe/Berlin").notes
    assert any("--zone is not used" in note for note in notes) != used
