"""The merging-unit double against Wireshark's dissector and on a veth pair."""

from __future__ import annotations

import contextlib
import itertools
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.doubles.sampled_values import SAFE_BURST, MergingUnitProcess, RecordedWave, Replay, SvStream, SvWave
from tests.doubles.sampled_values import quality as q
from tests.doubles.sampled_values.ber import length
from tests.doubles.sampled_values.pcap import read_pcap, write_pcap
from tests.doubles.veth import VethUnavailable, veth_pair
from tests.waiting import wait_for

ETHERTYPE = 0x88BA
FIELDS = ("smpCnt", "svID", "confRev", "smpSynch", "noASDU", "meas_value", "meas_quality", "appid", "length")
Wire = tuple[str, str]


def dissected(folder: Path, frames: Sequence[bytes], *fields: str) -> list[dict[str, list[str]]]:
    """The values of each field (without "sv.") in each frame, as Wireshark reads them."""
    if shutil.which("tshark") is None:
        pytest.skip("no tshark on PATH")
    write_pcap(folder / "frames.pcap", [(0.001 * n, frame) for n, frame in enumerate(frames)])
    names = [*(f"sv.{field}" for field in (*FIELDS, *fields)), "vlan.id", "vlan.priority", "_ws.expert.group"]
    command = ["tshark", "-r", str(folder / "frames.pcap"), "-o", "sv.decode_data_as_phsmeas:TRUE", "-T", "fields"]
    command += ["-E", "aggregator=;", "-E", "separator=/t", *itertools.chain(*(("-e", name) for name in names))]
    rows = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    return [dict(zip(names, [cell.split(";") for cell in row.split("\t")], strict=True)) for row in rows]


def numbers(cells: list[str]) -> list[int]:
    return [int(cell, 0) for cell in cells]


def counts(rows: Sequence[dict[str, list[str]]]) -> list[int]:
    """smpCnt of all ASDUs in the order of the frames."""
    return [number for row in rows for number in numbers(row["sv.smpCnt"])]


def assert_values(rows: list[dict[str, list[str]]], wave: SvWave, first: int = 0) -> None:
    values = np.array([numbers(row["sv.meas_value"]) for row in rows]).reshape(-1, 8)
    codes = wave.codes(first, len(values))
    np.testing.assert_array_equal(values[:, [4, 0, 5, 1, 6, 2]], codes)
    np.testing.assert_array_equal(values[:, 3], codes[:, 1::2].sum(axis=1))
    np.testing.assert_array_equal(values[:, 7], codes[:, 0::2].sum(axis=1))


PROFILES = [(4000, 1, 118), (4800, 1, 118), (4800, 2, 209), (14400, 6, 567), (12800, 8, 745)]
"""Rate, ASDUs and octets of a frame."""
TAGS = (None, 5)
"""VLANs."""


@pytest.fixture(scope="module")
def profiles(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[bytes, dict[str, list[str]]]]:
    """Four frames of every profile with and without a tag, and their fields: Wireshark is started once for all."""
    frames = []
    for vlan, (rate, asdus, _) in itertools.product(TAGS, PROFILES):
        stream = SvStream(rate, asdus, "MU0102", 0x4003, vlan, conf_rev=70_000, first_count=rate - asdus - 1)
        frames += [stream.frame(k) for k in range(4)]
    return list(zip(frames, dissected(tmp_path_factory.mktemp("profiles"), frames), strict=True))


@pytest.mark.parametrize("vlan", TAGS)
@pytest.mark.parametrize(("rate", "asdus", "octets"), PROFILES)
def test_wireshark_reads_each_profile_as_sent(
    profiles: list[tuple[bytes, dict[str, list[str]]]], rate: int, asdus: int, octets: int, vlan: int | None
) -> None:
    first = 4 * (TAGS.index(vlan) * len(PROFILES) + PROFILES.index((rate, asdus, octets)))
    frames, rows = zip(*profiles[first : first + 4], strict=True)
    assert {len(frame) for frame in frames} == {octets + (0 if vlan is None else 4)}
    assert all(row["_ws.expert.group"] == [""] for row in rows)
    assert {(row["vlan.id"][0], row["vlan.priority"][0]) for row in rows} == (
        {("", "")} if vlan is None else {("5", "4")}
    )
    for row in rows:
        assert set(row["sv.svID"]) == {"MU0102"} and numbers(row["sv.appid"]) == [0x4003]
        assert set(row["sv.confRev"]) == {"70000"} and set(row["sv.smpSynch"]) == {"2"}
        assert row["sv.noASDU"] == [str(asdus)] and row["sv.length"] == [str(octets - 14)]
        assert numbers(row["sv.meas_quality"]) == ([0, 0, 0, q.DERIVED] * 2) * asdus
    sent = [number for row in rows for number in numbers(row["sv.smpCnt"])]
    assert sent == [(rate - asdus - 1 + n) % rate for n in range(4 * asdus)]
    assert 0 in sent, "the second ends within these frames"
    assert_values(list(rows), SvWave(rate))


@pytest.mark.parametrize("octets", [1, 2, 3])
def test_wireshark_reads_long_lengths_and_optional_fields(tmp_path: Path, octets: int) -> None:
    stream = SvStream(
        long_lengths=octets, svid="S" * 60, dat_set="MU01/LLN0$PhsMeas1", refr_tm=True, smp_rate=True, smp_mod=1
    )
    row = dissected(tmp_path, [stream.frame(2400)], "datSet", "refrTm", "smpRate", "smpMod")[0]
    assert row["_ws.expert.group"] == [""]
    assert row["sv.svID"] == ["S" * 60] * 2 and row["sv.datSet"] == ["MU01/LLN0$PhsMeas1"] * 2
    assert row["sv.smpRate"] == ["4800"] * 2 and row["sv.smpMod"] == ["1"] * 2
    assert row["sv.refrTm"][0].startswith("Nov 14, 2023 22:13:21.000000000") and row["sv.smpCnt"] == ["0", "1"]


def test_the_shortest_length_is_chosen() -> None:
    assert [length(n) for n in (0x7F, 0x80, 0xFF, 0x100)] == [b"\x7f", b"\x81\x80", b"\x81\xff", b"\x82\x01\x00"]
    assert length(0x5F, 2) == b"\x82\x00\x5f"


def test_a_layout_of_three_and_three_leaves_the_neutrals_out(tmp_path: Path) -> None:
    row = dissected(tmp_path, [SvStream(layout="I3U3", asdus=1).frame(7)])[0]
    assert numbers(row["sv.meas_value"]) == SvWave(4800).codes(7, 1)[0, [1, 3, 5, 0, 2, 4]].tolist()


def test_channels_without_a_sensor_are_invalid(tmp_path: Path) -> None:
    row = dissected(tmp_path, [SvStream(phases=1, asdus=1).frame(7)])[0]
    u, i = SvWave(4800, 1).codes(7, 1)[0].tolist()
    assert numbers(row["sv.meas_value"]) == [i, 0, 0, i, u, 0, 0, u]
    assert numbers(row["sv.meas_quality"]) == [0, 1, 1, q.DERIVED] * 2


@pytest.mark.parametrize(
    "wrong", [{"appid": 0x3FFF}, {"appid": 0x8000}, {"asdus": 17}, {"layout": "U4"}, {"rate": 70_000}, {"vlan": 4096}]
)
def test_what_the_wire_cannot_carry_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError):
        SvStream(**wrong)


def test_the_wave_is_three_phase_mains_that_repeats() -> None:
    wave = SvWave(14_400)
    assert wave.codes(0, 10).dtype == np.int32
    np.testing.assert_array_equal(wave.codes(144_000 - 2, 4), wave.codes(-2, 4))
    values = wave.codes(0, 144_000) * np.array(wave.scale)
    np.testing.assert_allclose(np.sqrt((values**2).mean(axis=0)), [10e3 / 3**0.5, 40.0] * 3, rtol=1e-4)
    power = (values[:, 0::2] * values[:, 1::2]).mean(axis=0)
    np.testing.assert_allclose(power, wave.P, rtol=1e-4)


@pytest.fixture(scope="session")
def wire() -> Iterator[Wire]:
    """The two ends of a veth pair."""
    try:
        with veth_pair("svd") as pair:
            yield pair
    except VethUnavailable as reason:
        pytest.skip(str(reason))


class Receiver:
    """A packet socket on the other end of the wire."""

    def __init__(self, interface: str) -> None:
        # A socket opened with a protocol receives from every interface until it is bound: from another test's pair.
        self.socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
        self.socket.bind((interface, ETHERTYPE))
        self.socket.setblocking(False)

    def frames(self) -> list[bytes]:
        """Everything that has arrived."""
        found: list[bytes] = []
        with contextlib.suppress(BlockingIOError):
            while True:
                found.append(self.socket.recv(2048))
        return found


@pytest.fixture
def receiver(wire: Wire) -> Iterator[Receiver]:
    found = Receiver(wire[1])
    yield found
    found.socket.close()


@contextlib.contextmanager
def bursts(wire: Wire, **options: Any) -> Iterator[MergingUnitProcess]:
    with MergingUnitProcess(wire[0], clock="burst", rate=4000, **options) as unit:
        yield unit


def test_bursts_are_the_frames_of_the_stream(wire: Wire, receiver: Receiver) -> None:
    stream = SvStream(4000, 1)
    with bursts(wire) as unit:
        assert unit.burst(3) == 3 and unit.burst(SAFE_BURST - 3) == SAFE_BURST - 3
        assert receiver.frames() == [stream.frame(k) for k in range(SAFE_BURST)]
        assert unit.stats()["sent"] == unit.stats()["samples_intact"] == SAFE_BURST


def test_the_safe_burst_of_the_largest_frames_fits_a_default_socket_buffer(wire: Wire, receiver: Receiver) -> None:
    with MergingUnitProcess(wire[0], clock="burst", rate=12_800) as unit:
        unit.burst(SAFE_BURST)
    assert len(receiver.frames()) == SAFE_BURST


def test_smp_cnt_wraps_after_a_second_and_the_samples_go_on(wire: Wire, receiver: Receiver, tmp_path: Path) -> None:
    frames, stream = [], SvStream(4000, 1)
    with bursts(wire) as unit:
        for _ in range(51):
            unit.burst(80)
            frames += receiver.frames()
    assert frames == [stream.frame(k) for k in range(51 * 80)]
    rows = dissected(tmp_path, frames[3990:4010])
    assert counts(rows) == [n % 4000 for n in range(3990, 4010)]
    assert_values(rows, SvWave(4000), 3990)


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ({"drop": 2}, [2, 3, 4, 5]),
        ({"duplicate": 1}, [0, 0, 1, 2, 3, 4, 5]),
        ({"reorder": True}, [1, 0, 2, 3, 4, 5]),
        ({"pause_s": 3 / 4000}, [3, 4, 5]),
        ({"restart": True}, [0, 1, 2, 3, 4, 5]),
    ],
)
@pytest.mark.parametrize("before", [0, 7])
def test_faults_of_the_order(
    wire: Wire, receiver: Receiver, tmp_path: Path, command: dict[str, Any], expected: list[int], before: int
) -> None:
    with bursts(wire) as unit:
        unit.burst(before)
        receiver.frames()
        unit.command(**command)
        unit.burst(6)
        stats = unit.stats()
    frames, stream = receiver.frames(), SvStream(4000, 1)
    assert stats["sent"] == before + len(expected) and stats["next_sample"] == before + 6
    if "restart" not in command:
        assert frames == [stream.frame(before + n) for n in expected]
        return
    rows = dissected(tmp_path, frames)
    assert counts(rows) == expected
    assert_values(rows, SvWave(4000), before)


def test_faults_of_the_contents(wire: Wire, receiver: Receiver, tmp_path: Path) -> None:
    with bursts(wire) as unit:
        for command in (
            {"quality": q.INVALID_9_2LE | q.OVERFLOW | q.FAILURE, "channel": 4},
            {"synch": 0},
            {"confrev": 9},
            {"simulate": True},
            {"test": True},
            {"test": False, "simulate": False, "stream": 0},
            {"quality": 0},
        ):
            unit.command(**command)
            unit.burst(1)
    rows = dissected(tmp_path, receiver.frames(), "reserve1.s_bit")
    usual = [0, 0, 0, q.DERIVED]
    marked = [*usual, 0x45, 0, 0, q.DERIVED]
    qualities = [numbers(row["sv.meas_quality"]) for row in rows]
    assert qualities[:4] == [marked] * 4 and qualities[4] == [word | q.TEST for word in marked]
    assert qualities[5:] == [marked, [0] * 8]
    assert [row["sv.smpSynch"] for row in rows] == [["2"], *[["0"]] * 6]
    assert [row["sv.confRev"] for row in rows] == [["1"], ["1"], *[["9"]] * 5]
    assert [row["sv.reserve1.s_bit"][0] in ("1", "True") for row in rows] == [False] * 3 + [True] * 4


@pytest.mark.parametrize("vlan", [None, 5])
def test_damaged_frames(wire: Wire, receiver: Receiver, vlan: int | None) -> None:
    stream = SvStream(4000, 1, vlan=vlan)
    at = 22 if vlan is None else 26
    with bursts(wire, vlan=vlan) as unit:
        damaged = []
        for kind in ("cut", "count", "length", "tag"):
            unit.command(malformed=1, kind=kind)
            unit.burst(1)
            damaged += receiver.frames()
        unit.burst(1)
        assert unit.stats()["malformed"] == 4 and unit.stats()["samples_intact"] == 1
    # The kernel takes the VLAN tag out of the octets that the socket receives.
    whole = [frame[:12] + frame[at - 10 :] for frame in (stream.frame(k) for k in range(5))]
    assert [*map(len, damaged)] == [len(stream.frame(0)) // 2 - (at - 22), *[118] * 3]
    places = [[n for n in range(118) if damaged[k][n] != whole[k][n]] for k in (1, 2, 3)]
    assert places == [[26], [17], [22]]
    assert receiver.frames() == whole[4:]


def test_wireshark_calls_a_cut_frame_malformed(wire: Wire, receiver: Receiver, tmp_path: Path) -> None:
    with bursts(wire) as unit:
        unit.command(malformed=1)
        unit.burst(2)
    rows = dissected(tmp_path, receiver.frames())
    assert [row["_ws.expert.group"] != [""] for row in rows] == [True, False]


def test_two_streams_share_the_wire(wire: Wire, receiver: Receiver, tmp_path: Path) -> None:
    with bursts(wire, streams=2, svid=["LEFT", "RIGHT"], appid=0x4100) as unit:
        unit.command(drop=1, stream=1)
        assert unit.burst(3) == 5
        assert unit.stats(1)["dropped"] == 1
    rows = dissected(tmp_path, receiver.frames())
    assert [row["sv.svID"][0] for row in rows] == ["LEFT", "LEFT", "RIGHT", "LEFT", "RIGHT"]
    assert {(row["sv.svID"][0], row["sv.appid"][0]) for row in rows} == {("LEFT", "0x4100"), ("RIGHT", "0x4101")}
    assert_values([row for row in rows if row["sv.svID"] == ["RIGHT"]], SvWave(4000, seed=2), 1)


@pytest.mark.parametrize(("rate", "per_second"), [(4000, 4000), (4800, 2400), (12_800, 1600), (14_400, 2400)])
def test_the_real_clock_keeps_the_rate(wire: Wire, rate: int, per_second: int) -> None:
    with MergingUnitProcess(wire[0], rate=rate) as unit:
        assert unit.stats()["built"] == 0, "nothing leaves before start"
        begun = time.monotonic()
        unit.start()

        def in_time() -> bool:
            """Never ahead of the clock, and behind it only as far as a busy machine has made the frames late."""
            asked = time.monotonic()
            built, late_s = unit.stats()["built"], unit.command(stats=True)["late_max_s"]
            assert built <= per_second * (time.monotonic() - begun) + 1
            return built > per_second // 3 and built >= 0.95 * per_second * (asked - begun - late_s)

        wait_for(in_time, "frames at their rate")


def test_the_frames_of_a_stall_leave_afterwards(wire: Wire) -> None:
    with MergingUnitProcess(wire[0], rate=4000, autostart=True, drift_ppm=100) as unit:
        begun = time.monotonic()
        unit.command(stall_s=0.6)
        stalled = unit.stats()["built"]
        time.sleep(0.1)
        assert unit.stats()["built"] == stalled
        wait_for(lambda: unit.stats()["built"] - stalled >= 2600, "the frames of the stall")
        assert time.monotonic() - begun > 0.6
        assert unit.command(stats=True)["late_max_s"] > 0.5
        unit.command(stop=True)
        stopped = unit.stats()["built"]
        time.sleep(0.02)
        assert unit.stats()["built"] == stopped and not unit.command(stats=True)["running"]


def test_drift_changes_the_pace_only() -> None:
    fast, true = SvStream(drift_ppm=50.0), SvStream()
    assert fast.due_s(24_000) == pytest.approx(10.0 / 1.000050, abs=1e-9) and true.due_s(24_000) == 10.0
    assert fast.frame(11) == true.frame(11)


def test_a_capture_is_replayed_with_its_timing(wire: Wire, receiver: Receiver, tmp_path: Path) -> None:
    stream = SvStream(4000, 1)
    frames = [(100.0 + 0.02 * k, stream.frame(k)) for k in range(10)]
    write_pcap(tmp_path / "capture.pcap", frames)
    assert [frame for _, frame in read_pcap(tmp_path / "capture.pcap")] == [frame for _, frame in frames]
    assert Replay(tmp_path / "capture.pcap").due_s(9) == pytest.approx(0.18)
    with MergingUnitProcess(wire[0], pcap=tmp_path / "capture.pcap") as unit:
        begun = time.monotonic()
        unit.start()
        wait_for(lambda: unit.stats()["built"] >= 10, "the frames of the capture")
        assert time.monotonic() - begun > 0.17
        with pytest.raises(RuntimeError, match="no state"):
            unit.command(confrev=3)
    assert receiver.frames() == [frame for _, frame in frames]


@pytest.mark.parametrize("data", [b"", b"\x0a\x0d\x0d\x0a" * 9])
def test_another_capture_format_is_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "x.pcapng").write_bytes(data)
    with pytest.raises(ValueError, match="editcap"):
        read_pcap(tmp_path / "x.pcapng")


def test_the_recorded_unit_agrees_with_the_reference(waveforms: Path, tmp_path: Path) -> None:
    folder = waveforms / "merging_unit_3ph"
    wave = RecordedWave(folder / "source" / "E_wireshark_export.csv.gz")
    assert len(wave) == 25_600 and np.diff(wave.times_s).min() >= 0
    table = np.genfromtxt(folder / "ref_40ms.csv", delimiter=",", names=True)
    values = wave.codes(0, len(wave)) * np.array(wave.scale)
    volts = np.array([table["U_fix"][table["phase"] == phase].mean() for phase in (1, 2, 3)])
    np.testing.assert_allclose(np.sqrt((values[:, 0::2] ** 2).mean(axis=0)), volts, rtol=1e-4)
    frame = SvStream(4000, 1, "4000MU01", wave=wave).frame(0)
    assert len(frame) == 120, "octets of the recorded frames"
    row = dissected(tmp_path, [frame])[0]
    assert numbers(row["sv.meas_value"]) == [350997, -611364, 533608, -1484, 20504599, -55945920, 35080598, -803]
    assert numbers(row["sv.meas_quality"]) == [0] * 8


def test_the_recording_goes_out_on_the_wire(wire: Wire, receiver: Receiver, waveforms: Path) -> None:
    export = waveforms / "merging_unit_3ph" / "source" / "E_wireshark_export.csv.gz"
    with bursts(wire, recording=export, svid="4000MU01") as unit:
        unit.burst(3)
    stream = SvStream(4000, 1, "4000MU01", wave=RecordedWave(export))
    assert receiver.frames() == [stream.frame(k) for k in range(3)]
    with pytest.raises(RuntimeError, match="4000"), MergingUnitProcess(wire[0], recording=export, rate=4800):
        pass


def test_errors_are_answered_and_the_unit_lives_on(wire: Wire) -> None:
    with bursts(wire) as unit:
        for wrong in ({"nonsense": 1}, {"quality": 1, "channel": 9}, {"malformed": 1, "kind": "x"}, {"start": True}):
            with pytest.raises(RuntimeError):
                unit.command(**wrong)
        with pytest.raises(RuntimeError):
            unit.command(drop=1, stream=3)
        assert unit.burst(1) == 1
        assert unit.command(quit=True)["quit"]


def test_an_absent_interface_is_reported() -> None:
    with pytest.raises(RuntimeError, match=r"No such device|not permitted"), MergingUnitProcess("svd_absent0"):
        pass


def test_wireshark_reads_the_live_stream(wire: Wire) -> None:
    if shutil.which("tshark") is None:
        pytest.skip("no tshark on PATH")
    command = ["tshark", "-i", wire[1], "-f", "ether proto 0x88ba", "-c", "200", "-a", "duration:10", "-T", "fields"]
    command += ["-e", "sv.smpCnt", "-e", "sv.svID", "-e", "_ws.expert.group"]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as tshark,
        MergingUnitProcess(wire[0], rate=4800, svid="LIVE", autostart=True),
    ):
        rows = [row.split("\t") for row in tshark.communicate(timeout=20)[0].splitlines()]
    # A capture that begins in the middle of a stream may miss a frame; the numbers in a frame still follow one another.
    pairs = np.array([row[0].split(",") for row in rows], dtype=int)
    assert pairs.shape == (200, 2) and np.all(pairs[:, 0] % 2 == 0) and np.all(pairs[:, 1] - pairs[:, 0] == 1)
    assert np.all(np.diff(pairs[:, 0]) % 4800 % 4798 > 0), "frames in the order sent, none twice"
    assert {(row[1], row[2]) for row in rows} == {("LIVE,LIVE", "")}
