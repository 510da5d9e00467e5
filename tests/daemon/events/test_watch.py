"""Events of a stream as messages and waveforms: which samples are kept, how many files, what a broken disk does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from acqd.daemon.events.files import WaveformFiles
from acqd.daemon.events.section import EventsSection
from acqd.daemon.events.watch import EventWatch
from acqd.errors import SettingError
from acqd.metering import SampleBlock
from acqd.sources import Waveform, load_waveform
from tests.metering.quality.disturbed import RATE, blocks, form, voltages
from tests.waiting import wait_for

T0 = 1_700_000_000 * 10**9


def dip(begin, end, share=0.5):
    return lambda t, _: np.where((t >= begin) & (t < end), share, 1.0)


def watched(envelope, folder=None, *, seconds=4.0, drop=(0, 0), **section):
    """Messages, after the watch has come to its end."""
    told = []
    settings = EventsSection(enabled=True, declared_voltage=230.0, **section)
    watch = EventWatch(settings, form(), "cell1", "boot1", told.append, folder)
    u = voltages(envelope, seconds=seconds)
    for block in blocks(u):
        if not drop[0] <= block.index < drop[1]:
            watch.feed(replace(block, utc_ns=T0 + block.utc_ns))
    watch.finish()
    return told, u


def kept(folder):
    return sorted((folder / "events-cell1").glob("*.npz"))


def test_begin_and_end_are_reported_with_one_waveform_from_before_to_after(tmp_path):
    (begun, ended), u = watched(dip(1.0, 1.3), tmp_path)
    assert (begun.number, begun.duration, ended.kind, ended.phases) == (0, None, "dip", ["L1", "L2", "L3"])
    assert begun.waveform == ended.waveform and ended.duration == pytest.approx(0.3, abs=0.042)
    (file,) = kept(tmp_path)
    assert file.name == ended.waveform
    back = load_waveform(file)
    first = round(((back.start_utc_ns - T0) * 1e-9) * RATE)
    assert first == pytest.approx((1.0 - 0.2) * RATE, abs=200)
    np.testing.assert_allclose(back.codes[:, 0::2], u[first : first + len(back.codes)])
    assert back.duration == pytest.approx(0.2 + 0.3 + 0.2, abs=0.05)


def test_a_long_event_is_recorded_for_a_second_and_what_happens_in_it_is_in_its_file(tmp_path):
    told, _ = watched(dip(1.0, 3.5, 0.0), tmp_path, seconds=5.0)
    assert {(each.kind, each.waveform) for each in told} == {
        ("dip", told[0].waveform), ("interruption", told[0].waveform)
    }  # fmt: skip
    (file,) = kept(tmp_path)
    assert load_waveform(file).duration == pytest.approx(1.2, abs=0.05)


def test_a_rapid_change_is_reported_once_with_what_was_before_it(tmp_path):
    (one,), _ = watched(lambda t, _: np.where(t < 2, 1.0, 0.93), tmp_path)
    assert one.kind == "rvc" and one.duration is not None
    back = load_waveform(kept(tmp_path)[0])
    assert back.start_utc_ns - T0 == pytest.approx(1.8e9, abs=0.03e9)


def test_a_gap_ends_the_waveform(tmp_path):
    told, _ = watched(dip(1.0, 2.0), tmp_path, drop=(12_000, 13_000))
    assert [each.flags for each in told if each.duration is not None] == [["gap"], ["gap"]]
    first, second = kept(tmp_path)
    assert (load_waveform(first).start_utc_ns - T0) * 1e-9 + load_waveform(first).duration == pytest.approx(
        1.2, abs=0.01
    )
    assert load_waveform(second).start_utc_ns - T0 == pytest.approx(1.32e9, abs=1e6)


def test_without_a_folder_or_waveforms_nothing_is_kept(tmp_path):
    for folder, options in ((None, {}), (tmp_path, {"waveforms": False})):
        told, _ = watched(dip(1.0, 1.3), folder, **options)
        assert [each.waveform for each in told] == [None, None]
    assert list(tmp_path.iterdir()) == []


def piece() -> Waveform:
    codes = np.random.default_rng(0).integers(-9_999, 9_999, (2_000, 2)).astype(np.int16)
    return Waveform("x", codes, form(1), 0)


@pytest.mark.parametrize(("most", "most_bytes", "left"), [(3, 1e9, [5, 6, 7]), (99, 30_000, [6, 7]), (99, 1.0, [7])])
def test_the_oldest_files_go_first(tmp_path, most, most_bytes, left):
    files = WaveformFiles(tmp_path / "e", most, most_bytes)
    for k in range(8):
        files.save(f"2026-{k}.npz", piece())
        wait_for((tmp_path / "e" / f"2026-{k}.npz").exists, "the file")
    files.close()
    assert [path.name for path in sorted((tmp_path / "e").iterdir())] == [f"2026-{k}.npz" for k in left]


def test_a_disk_that_fails_is_logged_once_and_stops_nothing(tmp_path, caplog):
    (tmp_path / "e").write_text("no folder")
    files = WaveformFiles(tmp_path / "e", 9, 1e9)
    for k in range(3):
        files.save(f"{k}.npz", piece())
    files.close(9.0)
    assert len([record for record in caplog.records if "not kept" in record.message]) == 1


def test_a_waveform_of_16_bit_codes_stays_one(tmp_path):
    files = WaveformFiles(tmp_path, 9, 1e9)
    files.save("a.npz", Waveform("x", piece().codes, form(1), T0, simulated=True))
    files.close(9.0)
    assert load_waveform(tmp_path / "a.npz").simulated


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"declared_voltage": 0}, "greater than 0"),
        ({"declared_voltage": 230, "dip": 110}, "interruption < dip < 100 %"),
        ({"declared_voltage": 230, "hysteresis": 10}, "hysteresis: expected"),
        ({"declared_voltage": 230, "rapid_change": 60}, "rapid voltage changes: expected"),
        ({"sliding_reference": True, "post_s": 1e9}, "less than or equal to 60"),
    ],
)
def test_impossible_settings_are_refused(wrong, says):
    with pytest.raises(ValidationError, match=says):
        EventsSection(enabled=True, **wrong)


def test_blocks_of_any_length_give_the_same_messages():
    u = voltages(dip(1.0, 1.3), seconds=2.0)
    results = []
    for cuts in ([len(u) // 2], list(range(37, len(u), 37))):
        told: list = []
        watch = EventWatch(EventsSection(enabled=True, declared_voltage=230.0), form(), "c", "b", told.append, None)
        for block in blocks(u, cuts):
            watch.feed(SampleBlock(block.codes, block.index, block.utc_ns))
        watch.finish()
        results.append([(one.kind, one.time, one.duration and round(one.duration, 6)) for one in told])
    assert results[0] == results[1] and len(results[0]) == 2


def test_a_transient_is_reported_once_with_its_waveform(tmp_path):
    def ringing(t, _):
        late = np.maximum(t - 1.0, 0)
        return 1 + (t >= 1.0) * np.sin(2 * np.pi * 900 * late) * np.exp(-late / 3e-3)

    (one,), u = watched(ringing, tmp_path, seconds=2.0, transient=20)
    assert one.kind == "transient" and one.flags == ["oscillatory"] and 1e-3 < one.duration < 0.01
    (file,) = kept(tmp_path)
    assert file.name == one.waveform
    back = load_waveform(file)
    first = round((back.start_utc_ns - T0) * 1e-9 * RATE)
    assert first == pytest.approx(0.8 * RATE, abs=200) and back.duration == pytest.approx(0.4, abs=0.05)
    np.testing.assert_allclose(back.codes[:, 0::2], u[first : first + len(back.codes)])


def test_a_three_wire_system_has_events_of_the_voltages_between_its_lines():
    told = []
    settings = EventsSection(enabled=True, declared_voltage=230 * np.sqrt(3), line_to_line=True)
    watch = EventWatch(settings, form(), "cell1", "boot1", told.append, None)
    for block in blocks(voltages(lambda t, k: np.where((t > 1) & (t < 1.4) & (k == 0), 0.2, 1.0))):
        watch.feed(block)
    ended = [one for one in told if one.duration is not None and one.kind == "dip"]
    assert [(one.phases, one.flags) for one in ended] == [(["L1", "L3"], ["line_to_line"])]
    expected = 230 * abs(0.2 - np.exp(-2j * np.pi / 3))  # U1 - U2
    assert ended[0].extreme == pytest.approx(expected, abs=0.003 * 398) and ended[0].duration == pytest.approx(
        0.4, abs=0.011
    )
    with pytest.raises(SettingError, match="line_to_line: voltages between lines need three phases"):
        EventWatch(settings, form(1), "cell1", "boot1", told.append, None)
