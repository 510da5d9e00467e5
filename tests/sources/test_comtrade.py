"""COMTRADE files (IEEE C37.111)."""

from __future__ import annotations

import struct
import tracemalloc
from dataclasses import replace
from datetime import UTC, datetime

import comtrade
import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.sources import ChannelMap, ReplaySource, load_waveform
from acqd.sources.text_file import check_encoding
from tests.mains import make_mains
from tests.sources.comtrade import Recording

KINDS = ("ASCII", "BINARY", "BINARY32", "FLOAT32")


@pytest.fixture(scope="module")
def recording():
    return Recording(make_mains(50.1, seconds=0.5))


def metered(waveform, mode="fixed"):
    return Meter(waveform.form, mode=mode).feed(SampleBlock(waveform.codes, 0, 0))


def as_recorded(recording):
    mains = recording.mains
    return Meter(StreamFormat(mains.rate, mains.scale), mode="fixed").feed(SampleBlock(mains.codes, 0, 0))


def assert_exact(batch, truth):
    for name in ("Vrms", "Irms", "P", "W"):
        np.testing.assert_allclose(getattr(batch, name), getattr(truth, name), rtol=1e-9)


@pytest.mark.parametrize("edition", [1991, 1999, 2013])
@pytest.mark.parametrize("kind", KINDS)
def test_every_edition_and_file_type_is_exact(tmp_path, recording, edition, kind):
    stamp = "06/25/07,19:13:57.789757" if edition == 1991 else recording.stamp
    tail = ("1", "0,0", "0,0") if edition == 2013 else ("1",)
    path = replace(recording, edition=edition, kind=kind, stamp=stamp, tail=tail).write(tmp_path)
    waveform = load_waveform(path)
    assert waveform.start_utc_ns == 1_182_798_837_789_757_000
    assert_exact(metered(waveform), as_recorded(recording))
    codes = recording.mains.codes
    assert kind != "BINARY" or (codes == -1).any()  # an ordinary value, also in 1991


def test_an_offset_is_added(tmp_path, recording):
    waveform = load_waveform(replace(recording, offset=2.5).write(tmp_path))
    np.testing.assert_allclose(
        waveform.codes, recording.mains.codes * np.array(recording.mains.scale) + 2.5, rtol=1e-12
    )


def test_converters_without_a_sign(tmp_path, recording):
    numbers = (recording.mains.codes.astype(np.int64) + 2**15).astype(np.uint16).view(np.int16)
    offset = -(2**15) * recording.mains.scale[0]
    shifted = replace(
        recording, edition=1991, numbers=numbers, limits=(0, 65_535), stamp="06/25/07,19:13:57.0", offset=offset
    )
    waveform = load_waveform(shifted.write(tmp_path))
    np.testing.assert_allclose(waveform.codes[:, 0], recording.mains.codes[:, 0] * recording.mains.scale[0], atol=1e-9)


def test_the_comtrade_package_reads_the_same(tmp_path, recording):
    path = replace(recording, kind="BINARY32").write(tmp_path)
    other = comtrade.Comtrade(use_double_precision=True)
    other.load(str(path), str(path.with_suffix(".dat")))
    np.testing.assert_allclose(load_waveform(path).codes.T, np.array(other.analog), rtol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_data_cut_in_half_are_refused(tmp_path, recording, kind):
    path = replace(recording, kind=kind).write(tmp_path)
    data = path.with_suffix(".dat")
    data.write_bytes(data.read_bytes()[: data.stat().st_size // 2])
    with pytest.raises(InputError, match=r"truncated: \d+ of 10000 samples|fields, expected 8"):
        load_waveform(path)


@pytest.mark.parametrize("kind", KINDS)
def test_combined_files(tmp_path, recording, kind):
    parts = replace(recording, kind=kind)
    data = parts.data()
    size = "" if kind == "ASCII" else f": {len(data)}"
    cff = (
        b"--- file type: CFG ---\r\n"
        + parts.header()
        + b"--- file type: INF ---\r\nx\r\n--- file type: HDR ---\r\ny\r\n"
    )
    (tmp_path / "a.cff").write_bytes(cff + f"--- file type: DAT {kind}{size} ---\r\n".encode() + data)
    assert_exact(metered(load_waveform(tmp_path / "a.cff")), as_recorded(recording))
    (tmp_path / "no part.cff").write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match="lacks a CFG and a DAT part"):
        load_waveform(tmp_path / "no part.cff")
    (tmp_path / "b.cff").write_bytes(cff)
    with pytest.raises(InputError, match="lacks a CFG and a DAT part"):
        load_waveform(tmp_path / "b.cff")


@pytest.mark.parametrize(("code", "hours"), [("-5h30", 5.5), ("+2", -2), ("0", 0), ("x", 0), ("10h15", -10.25)])
def test_time_codes_of_2013(tmp_path, recording, code, hours):
    path = replace(recording, edition=2013, tail=("1", f"{code},x", "0,0")).write(tmp_path)
    local = datetime(2007, 6, 25, 19, 13, 57, 789757, UTC)
    assert load_waveform(path).start_utc_ns == round(local.timestamp() * 1e6) * 1000 + round(hours * 3600e9)


def test_a_time_code_that_is_none_is_named(tmp_path, recording):
    path = replace(recording, edition=2013, tail=("1", "soon,x", "0,0")).write(tmp_path)
    waveform = load_waveform(path)
    assert waveform.start_utc_ns is None and "time code 'soon' is not like -5h30" in " ".join(waveform.notes)


def test_headers_in_latin_1(tmp_path, recording):
    names = ("Vä", "Iä", "VB", "IB", "VC", "IC")
    path = replace(recording, station="Münster", names=names).write(tmp_path, "latin-1")
    assert load_waveform(path).form.phases == 3
    assert load_waveform(path, ChannelMap({"u1": "Vä", "i1": "Iä"})).form.phases == 1
    assert load_waveform(path, ChannelMap({"u1": "Vф", "i1": "Iф"}, encoding="iso8859-5")).form.phases == 1
    with pytest.raises(InputError, match="is not text in ascii"):
        load_waveform(path, ChannelMap(encoding="ascii"))
    with pytest.raises(UserError, match="--encoding: 'klingon'"):
        check_encoding("klingon")


def test_secondary_quantities_become_primary(tmp_path, recording):
    ratios = ((20_000.0, 100.0, "S"), (400.0, 5.0, "S")) * 3
    path = replace(recording, ratios=ratios).write(tmp_path)
    truth = as_recorded(recording)
    np.testing.assert_allclose(metered(load_waveform(path)).P, truth.P * 200 * 80, rtol=1e-9)
    primary = replace(recording, ratios=tuple((a, b, "P") for a, b, _ in ratios))
    np.testing.assert_allclose(metered(load_waveform(primary.write(tmp_path))).P, truth.P, rtol=1e-9)


def test_channels_that_are_sampled_later_are_interpolated(tmp_path):
    """Currents 40 us (0.8 samples) late: read without correction, P at PF 0.5 would be 2.2 % off."""
    lag = float(np.arccos(0.5))
    f, skew = 50.0, 40e-6
    mains = make_mains(f, seconds=1.0, lag=lag)
    late = make_mains(f, seconds=1.0, lag=lag - 2 * np.pi * f * skew)
    late.codes[:, 0::2] = mains.codes[:, 0::2]
    path = Recording(late, skews_us=(0.0, 40.0) * 3).write(tmp_path)
    batch = metered(load_waveform(path), "synchronous")
    np.testing.assert_allclose(batch.P[:, 1:], mains.P, rtol=1e-4)


def test_segments_of_one_rate_are_one_recording(tmp_path, recording):
    path = replace(recording, segments=((20_000.0, 4_000), (20_000.0, 10_000))).write(tmp_path)
    assert_exact(metered(load_waveform(path)), as_recorded(recording))
    path = replace(recording, segments=((20_000.0, 4_000), (10_000.0, 10_000))).write(tmp_path)
    with pytest.raises(InputError, match="changes its sampling rate"):
        load_waveform(path)


def test_a_pause_between_segments_is_a_gap(tmp_path, recording):
    path = replace(recording, segments=((20_000.0, 4_000), (20_000.0, 10_000))).write(tmp_path)
    data = path.with_suffix(".dat")
    rows = np.frombuffer(data.read_bytes(), "<u4").copy().reshape(-1, 5)
    rows[4_000:, 1] += 80_000
    data.write_bytes(rows.tobytes())
    waveform = load_waveform(path)
    assert waveform.breaks == ((4_000, 1_600),) and waveform.duration == pytest.approx(0.58)
    assert any("pauses (0.08 " in note and "before sample 4001" in note for note in waveform.notes)
    source = ReplaySource(waveform)
    source.open(0)
    blocks = []
    while (block := source.read(3_000)) is not None:
        blocks.append(block)
    assert [(block.index, len(block.codes), block.lost) for block in blocks] == [
        (0, 3_000, 0), (3_000, 1_000, 0), (5_600, 3_000, 1_600), (8_600, 3_000, 0),
    ]  # fmt: skip
    meter = Meter(waveform.form)
    batches = [batch for batch in map(meter.feed, blocks) if batch is not None]
    flags = [flags for batch in batches for flags in batch.flags[0]]
    # the pause ends exactly with window 6: the windows in the pause have no row, the next one is flagged
    assert "gap" in flags[5] and [batch.seq[-1] for batch in batches][-1] == 13


def test_rates_from_the_times_of_the_samples(tmp_path, recording):
    path = replace(recording, segments=((0.0, 10_000),)).write(tmp_path)
    assert load_waveform(path).form.rate == pytest.approx(20_000)


def test_equal_channel_names_are_told_apart_by_their_units_or_refused(tmp_path, recording):
    path = replace(recording, names=("A", "A", "B", "B", "C", "C")).write(tmp_path)
    assert_exact(metered(load_waveform(path)), as_recorded(recording))
    chosen = ChannelMap({"u1": "0", "i1": "1", "u2": "2", "i2": "3", "u3": "4", "i3": "5"})
    assert_exact(metered(load_waveform(path, chosen)), as_recorded(recording))
    path.write_text(path.read_text().replace("A,A,,A", "A,A,,V"))
    with pytest.raises(InputError, match=r"two analog channels for u1, 'A' and 'A'.*0=A, 1=A, 2=B"):
        load_waveform(path)
    with pytest.raises(InputError, match=r"2 analog channels with the name 'A'"):
        load_waveform(path, ChannelMap({"u1": "A", "i1": "1"}))


def test_a_map_that_takes_a_current_for_a_voltage_is_refused(tmp_path, recording):
    path = recording.write(tmp_path)
    swapped = {"u1": "IA", "i1": "VA"}
    with pytest.raises(InputError, match=r"'IA' for u1 is in A; expected V .*--u-scale"):
        load_waveform(path, ChannelMap(swapped))
    assert load_waveform(path, ChannelMap(swapped, u_scale=2.0, i_scale=3.0)).form.phases == 1


def test_channels_beside_the_metered_ones_are_named(tmp_path, recording):
    path = replace(recording, names=("VA", "IA", "VA2", "IA2", "VB", "IB")).write(tmp_path)
    path.write_text(path.read_text().replace("VA2,B", "VA2,A").replace("IA2,B", "IA2,A").replace("B,C", "B,B"))
    (note,) = load_waveform(path).notes
    assert note == "metered are u1=VA, i1=IA, u2=VB, i2=IB; it also has VA2, IA2 (--map selects)"


def test_data_that_are_longer_than_announced_are_named(tmp_path, recording):
    path = replace(recording, segments=((20_000.0, 8_000),)).write(tmp_path)
    waveform = load_waveform(path)
    assert len(waveform.codes) == 8_000
    assert waveform.notes[-1] == "has 10000 samples, of which its header announces the first 8000"


def test_a_missing_sample_is_named(tmp_path):
    mains = make_mains(50.0, seconds=0.2)
    mains.codes[77, 3] = -32_768
    with pytest.raises(InputError, match="sample 78 of channel 'IB' is marked as missing"):
        load_waveform(Recording(mains).write(tmp_path))


@pytest.mark.parametrize("kind", KINDS)
def test_headers_that_announce_too_much_take_no_memory(tmp_path, recording, kind):
    path = replace(recording, kind=kind, segments=((20_000.0, 10**9),)).write(tmp_path)
    path.with_suffix(".dat").write_bytes(recording.data()[:200] if kind != "ASCII" else b"1,0,1,2,3,4,5,6\n")
    assert_refused_in_little_memory(path, "truncated")


@pytest.mark.parametrize("counts", ["900000000,900000000A,0D", "6,6A,900000000D", "6,-1A,0D", "6,xA,0D", "6"])
def test_headers_that_announce_too_many_channels(tmp_path, recording, counts):
    path = recording.write(tmp_path)
    path.write_bytes(recording.header().replace(b"6,6A,0D", counts.encode()))
    assert_refused_in_little_memory(path, "header, line 2")


def assert_refused_in_little_memory(path, complaint):
    tracemalloc.start()
    with pytest.raises(InputError, match=complaint):
        load_waveform(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 3_000_000


def test_memory_is_bounded_by_the_size_of_the_file(tmp_path):
    for kind in KINDS:
        path = Recording(make_mains(50.0, seconds=5.0), kind=kind).write(tmp_path)
        tracemalloc.start()
        load_waveform(path)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 3 * path.with_suffix(".dat").stat().st_size


def test_a_header_cut_anywhere_is_one_line(tmp_path, recording):
    path = recording.write(tmp_path)
    header = recording.header()
    for length in range(1, len(header) - 30, 7):
        path.write_bytes(header[:length])
        with pytest.raises(InputError):
            load_waveform(path)


def test_comtrade_without_phase_letters(waveforms):
    waveform = load_waveform(waveforms / "ion7650_3ph_60hz" / "source" / "keating_1999.CFG")
    assert waveform.form.phases == 3 and waveform.form.f_nominal == 60.0
    assert waveform.form.rate == pytest.approx(30_707.24, abs=0.01)


@pytest.mark.parametrize(("factor", "refused"), [(1.0, False), (1e-3, False), (2.0, True)])
def test_times_that_contradict_the_rate_are_refused_unless_their_unit_explains_them(tmp_path, factor, refused):
    one = Recording(make_mains(50.0, seconds=0.2, phases=1, rate=10_000.0))
    data = b"".join(
        struct.pack("<IIhh", n + 1, round(n * 100_000 * factor), *map(int, row)) for n, row in enumerate(one.codes)
    )
    (tmp_path / "r.cfg").write_bytes(replace(one, tail=("0.001",)).header())
    (tmp_path / "r.dat").write_bytes(data)
    if refused:
        with pytest.raises(InputError, match=r"10000 samples/s, the times of its samples 5000; .*--rate"):
            load_waveform(tmp_path / "r.cfg")
    given = ChannelMap(rate=10_000.0) if refused else ChannelMap()
    assert load_waveform(tmp_path / "r.cfg", given).form.rate == 10_000


def test_rows_that_are_doubled_exchanged_or_of_another_width_are_refused(tmp_path, recording):
    path = replace(recording, kind="ASCII").write(tmp_path)
    rows = path.with_suffix(".dat").read_bytes().split(b"\r\n")
    for wrong in ([*rows[:700], rows[699], *rows[700:]], [*rows[:700], rows[701], rows[700], *rows[702:]]):
        path.with_suffix(".dat").write_bytes(b"\r\n".join(wrong))
        with pytest.raises(InputError, match="doubled or out of order"):
            load_waveform(path)
    path = recording.write(tmp_path)
    text, data = path.read_text(), path.with_suffix(".dat").read_bytes()
    path.with_suffix(".dat").write_bytes(b"".join(data[k : k + 20] + b"\0\0" for k in range(0, len(data), 20)))
    with pytest.raises(InputError, match="6 analog, 0 status channels"):
        load_waveform(path)
    path.write_text(text.replace("6A,0D", "6A,1D").replace("\n50\n", "\n1,D1,,,0\n50\n"))
    assert load_waveform(path).form.phases == 3


@pytest.mark.parametrize("time", [0, 0xFFFFFFFF])
@pytest.mark.parametrize(
    "numbers",
    [
        lambda k: 0 * k,
        lambda k: 1 + 4 * k,
        lambda k: k % 700 + 1,
        lambda k: (k + 65_000) % 65_536,
        lambda k: np.minimum(k + 1, len(k) - 5),
    ],
)
def test_numbers_that_count_otherwise_are_no_disorder(tmp_path, recording, numbers, time):
    path = recording.write(tmp_path)
    data = path.with_suffix(".dat")
    rows = np.frombuffer(data.read_bytes(), "<u4").reshape(-1, 5).copy()  # number, time, 6 values
    rows[:, 0], rows[:, 1] = numbers(np.arange(len(rows))), time
    data.write_bytes(rows.tobytes())
    assert load_waveform(path).form.phases == 3


def test_marks_of_order_blank_lines_and_dates_do_not_stop_a_recording(tmp_path, recording):
    path = replace(recording, edition=2013, kind="ASCII", tail=("1", "0,x", "0,0")).write(tmp_path)
    cfg, dat = path.read_bytes(), path.with_suffix(".dat").read_bytes()
    parts = b"\xef\xbb\xbf--- file type: CFG ---\r\n", cfg, b"--- file type: DAT ASCII ---\r\n", dat
    (tmp_path / "r.cff").write_bytes(b"".join(parts))
    assert load_waveform(tmp_path / "r.cff").form.phases == 3
    path.write_bytes(cfg.replace(b",0D\r\n", b",0D\r\n\r\n"))
    assert load_waveform(path).form.phases == 3
    for stamp, hour in (("25/06/2007,24:00:00.0", 24), ("25/06/2007 19:00:00.0", 19), ("someday", None)):
        path = replace(recording, stamp=stamp).write(tmp_path)
        waveform = load_waveform(path)
        midnight = datetime(2007, 6, 25, tzinfo=UTC).timestamp()
        assert waveform.start_utc_ns == (None if hour is None else round((midnight + 3600 * hour) * 1e9))
        assert any("--start" in note for note in waveform.notes) == (hour is None)
