"""The EtherCAT double against independent masters (SOEM, KickCAT) and an independent decoder (tshark)."""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.doubles.ethercat.control import DoubleError, EtherCatDouble
from tests.doubles.veth import VethUnavailable, namespace_command, veth_pair
from tests.doubles.waveform import WaveTable

pysoem = pytest.importorskip("pysoem")

FACTORS = (1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 80, 100)
SYNC0 = 50_000
SAFEOP, OP, ACK = 4, 8, 0x10
TIMEOUT_US = 500_000
STATE_TIMEOUT_US = 1_000_000
STATE_REQUESTS = 20  # a busy machine changes state late
LOST = (pysoem.ConfigMapError, pysoem.MailboxError, pysoem.PacketError, pysoem.WkcError)


@pytest.fixture(scope="module")
def pair() -> Iterator[tuple[str, str]]:
    try:
        with veth_pair("ecatt") as names:
            yield names
    except VethUnavailable as reason:
        pytest.skip(f"no veth pair: {reason}")


def assignment(factor: int) -> list[int]:
    j = FACTORS.index(factor)
    return [0x1A00 + 16 * c + k for c in range(6) for k in (0, 1 + j)] + [0x1A60, 0x1A61, 0x1A62, 0x1A63]


class Block:
    """One terminal's image: six channels of status and samples, then time, count, diagnosis, range."""

    def __init__(self, image: bytes, factor: int) -> None:
        channels = np.frombuffer(image[: 12 * (factor + 1)], dtype="<i2").reshape(6, factor + 1)
        self.codes = channels[:, 1:].T
        self.status = channels[:, 0].view("<u2").tolist()
        self.next_time, self.count, self.diagnosis, self.ranges = struct.unpack("<QHHH", image[12 * (factor + 1) :])

    @property
    def valid(self) -> bool:
        return not self.status[0] & 0x4000


class Soem:
    """A master at one end of the pair."""

    def __init__(self, interface: str, factor: int) -> None:
        self.factor = factor
        patience = pysoem.settings.timeouts  # the double is a process, which a busy machine keeps waiting
        patience.ret = patience.safe = patience.tx_mailbox = TIMEOUT_US
        self.master = pysoem.Master()
        self.master.open(interface)

    def configure(self, sync1: int | None = None) -> None:
        """Begins again where a request was lost, which waits for 6 ms on a busy machine, too."""
        for _ in range(STATE_REQUESTS):
            with suppress(*LOST):
                return self._configure(sync1)
        raise AssertionError("no request is answered in time")

    def _configure(self, sync1: int | None) -> None:
        assert self.master.config_init() > 1
        for slave in self.master.slaves[1:]:
            slave.setup_func = lambda _, slave=slave: self._assign(slave)
        self.master.config_map()
        assert self.master.config_dc()
        for slave in self.master.slaves[1:]:
            slave.dc_sync(True, SYNC0, 0, (self.factor - 1) * SYNC0 if sync1 is None else sync1)
        self.reach(SAFEOP)

    def _assign(self, slave: Any) -> None:
        slave.sdo_write(0x1C13, 0, b"\0")
        for k, index in enumerate(assignment(self.factor), start=1):
            slave.sdo_write(0x1C13, k, struct.pack("<H", index))
        slave.sdo_write(0x1C13, 0, bytes((len(assignment(self.factor)),)))

    def operate(self) -> None:
        self.reach(OP)

    def reach(self, state: int) -> None:
        """Asks again: on a busy machine one of the requests, which wait for 6 ms, may be lost."""
        for _ in range(STATE_REQUESTS):
            self.request(state)
            if self.master.state_check(state, STATE_TIMEOUT_US) == state:
                return
        raise AssertionError(f"terminals in state {self.master.state_check(state, STATE_TIMEOUT_US)}, not {state}")

    def request(self, state: int) -> None:
        self.master.state = state
        self.master.write_state()

    def cycle(self, timeout_us: int = TIMEOUT_US) -> int:
        self.master.send_processdata()
        return int(self.master.receive_processdata(timeout_us))

    def blocks(self) -> list[Block]:
        """The next image of each terminal."""
        assert self.cycle() == self.master.expected_wkc
        return [Block(slave.input, self.factor) for slave in self.master.slaves[1:]]

    def first_valid(self) -> list[Block]:
        for _ in range(5000):
            blocks = self.blocks()
            if all(block.valid for block in blocks):
                return blocks
        raise AssertionError("no valid block")

    def al_status(self, terminal: int = 0) -> tuple[int, int]:
        self.master.read_state()
        slave = self.master.slaves[1 + terminal]
        return slave.state, slave.al_status


@contextmanager
def running(
    pair: tuple[str, str], factor: int = 20, *, operate: bool = True, **options: Any
) -> Iterator[tuple[Soem, EtherCatDouble]]:
    with EtherCatDouble(pair[1], **options) as double:
        soem = Soem(pair[0], factor)
        try:
            if operate:
                soem.configure()
                soem.operate()
            yield soem, double
        finally:
            soem.master.close()


def test_identities_and_objects(pair: tuple[str, str]) -> None:
    with running(pair, operate=False, terminals=3) as (soem, _):
        assert soem.master.config_init() == 4
        identities = [(slave.name, slave.man, slave.id) for slave in soem.master.slaves]
        assert identities == [("EK1100", 2, 0x044C2C52)] + 3 * [("EL3783", 2, 0x0EC73052)]
        assert [slave.rev for slave in soem.master.slaves[1:]] == 3 * [0x00120000]
        slave = soem.master.slaves[3]
        assert slave.sdo_read(0x1018, 2) == struct.pack("<I", 0x0EC73052)
        assert slave.sdo_read(0x1008, 0) == b"EL3783"  # six bytes: a normal upload
        bits = [slave.sdo_read(0x1A00, k)[0] for k in range(1, slave.sdo_read(0x1A00, 0)[0] + 1)]
        assert bits == [1, 1, 2, 2, 1, 6, 1, 1, 1]
        for j, factor in enumerate(FACTORS):
            assert slave.sdo_read(0x1A51 + j, 0) == bytes((factor,))
            assert slave.sdo_read(0x1A51 + j, factor) == struct.pack("<I", 0x60520010 | factor << 8)


def test_long_object_comes_in_segments(pair: tuple[str, str]) -> None:
    with running(pair, operate=False) as (soem, _):
        soem.master.config_init()
        mapping = soem.master.slaves[1].sdo_read(0x1A0F, 0, 1000, ca=True)
        assert len(mapping) == 402
        assert mapping[2:] == b"".join(struct.pack("<I", 0x60020010 | k << 8) for k in range(1, 101))


def test_refusals_carry_their_abort_codes(pair: tuple[str, str]) -> None:
    with running(pair) as (soem, _):
        slave = soem.master.slaves[1]
        for index, subindex, data, code in (
            (0x2000, 0, None, 0x06020000),
            (0x1018, 9, None, 0x06090011),
            (0x1018, 1, b"1234", 0x06010002),
            (0xF800, 1, b"\5", 0x06090030),
            (0x1C13, 0, b"\0", 0x08000022),
        ):
            with pytest.raises(pysoem.SdoError) as refusal:
                slave.sdo_read(index, subindex) if data is None else slave.sdo_write(index, subindex, data)
            assert refusal.value.abort_code == code


@pytest.mark.parametrize(("factor", "terminals", "cycles"), [(20, 1, 2000), (20, 3, 500), (100, 1, 500), (100, 3, 300)])
def test_every_block_arrives_once(pair: tuple[str, str], factor: int, terminals: int, cycles: int) -> None:
    tables = [WaveTable(seed=1 + t) for t in range(terminals)]
    with running(pair, factor, terminals=terminals) as (soem, double):
        blocks = soem.first_valid()
        start = blocks[0].next_time - factor * SYNC0
        for number in range(cycles):
            for block, table in zip(blocks, tables, strict=True):
                np.testing.assert_array_equal(block.codes, table.codes(number * factor, factor))
                assert block.count == number
                assert block.next_time == start + (number + 1) * factor * SYNC0
                assert block.status == 6 * [0x8000 * (number & 1)]
            blocks = soem.blocks()
        assert double.stats()["blocks_sent"] == cycles + 1


def test_no_samples_before_the_start_time(pair: tuple[str, str]) -> None:
    with running(pair) as (soem, _):
        waiting = 0
        while not (block := soem.blocks()[0]).valid:
            assert block.status == 6 * [0x4000] and block.next_time == 0 and not block.codes.any()
            waiting += 1
        assert 80 <= waiting <= 110  # 100 ms in blocks of 1 ms


def test_wrong_sync1_is_refused(pair: tuple[str, str]) -> None:
    with running(pair, operate=False) as (soem, _):
        soem.configure(sync1=18 * SYNC0)
        assert soem.blocks()[0].status == 6 * [0x6000]
        soem.request(OP)
        assert soem.al_status() == (SAFEOP | ACK, 0x0030)


def test_real_clock_shows_the_newest_block(pair: tuple[str, str]) -> None:
    table = WaveTable(seed=1)
    with running(pair, clock="real") as (soem, _):
        counts, begun = [], time.monotonic()
        while len(counts) < 400:
            block = soem.blocks()[0]
            if block.valid:
                np.testing.assert_array_equal(block.codes, table.codes(block.count * 20, 20))
                counts.append(block.count)
        assert counts == sorted(counts)
        assert 0 < counts[-1] - counts[0] <= 1000 * (time.monotonic() - begun) + 1
        time.sleep(0.05)
        assert soem.blocks()[0].count >= counts[-1] + 40  # what was not polled is lost


def test_real_clock_faults(pair: tuple[str, str]) -> None:
    with running(pair, clock="real") as (soem, double):
        before = soem.first_valid()[0].count
        double.command(drop_blocks=300)
        counts = [before, soem.blocks()[0].count]
        while counts[-1] < before + 300:
            counts.append(soem.blocks()[0].count)
        assert max(np.diff(counts)) >= 300
        double.command(repeat=3)
        count = soem.blocks()[0].count
        time.sleep(0.01)
        assert [soem.blocks()[0].count - count for _ in range(2)] == [0, 0]
        assert soem.blocks()[0].count > count
        double.command(dc_drift_ppm=20_000)
        passed = []  # host's time before and after, the segment's time in between
        for _ in range(2):
            before_ns = time.monotonic_ns()
            soem.cycle()
            passed.append((before_ns, soem.master.dc_time, time.monotonic_ns()))
            time.sleep(0.3)
        (begun, first, started), (stopped, second, ended) = passed
        assert (second - first) / (ended - begun) < 1.021 and (second - first) / (stopped - started) > 1.019


def test_dropped_frames_lose_their_blocks(pair: tuple[str, str]) -> None:
    with running(pair) as (soem, double):
        before = soem.first_valid()[0].count
        double.command(drop_frames=3)
        assert [soem.cycle(20_000) for _ in range(3)] == 3 * [-1]
        assert soem.blocks()[0].count == before + 4
        stats = double.stats()
        assert (stats["blocks_sent"], stats["first_block"], stats["last_block"]) == (2, before, before + 4)


def test_skipped_and_repeated_blocks(pair: tuple[str, str]) -> None:
    with running(pair) as (soem, double):
        before = soem.first_valid()[0]
        double.command(drop_blocks=5)
        after = soem.blocks()[0]
        assert (after.count, after.next_time) == (before.count + 6, before.next_time + 6_000_000)
        np.testing.assert_array_equal(after.codes, WaveTable(seed=1).codes(after.count * 20, 20))
        double.command(repeat=2)
        assert [soem.blocks()[0].count - after.count for _ in range(3)] == [0, 0, 1]


def test_status_faults(pair: tuple[str, str]) -> None:
    with running(pair) as (soem, double):
        soem.first_valid()
        double.command(overrange=3)
        assert [word & 0x0002 for word in soem.blocks()[0].status] == [0, 0, 0, 2, 0, 0]
        double.command(overrange=None, sync_error=True)
        double.command(sync_error=True)
        assert all(word & 0x2000 and not word & 0x0002 for word in soem.blocks()[0].status)
        double.command(sync_error=False)
        double.command(invalid=True)
        assert all(word & 0x6000 == 0x4000 for word in soem.blocks()[0].status)
        double.command(invalid=False)
        assert soem.blocks()[0].valid


def test_range_changes_codes_and_its_bit(pair: tuple[str, str]) -> None:
    with running(pair) as (soem, double):
        soem.first_valid()
        double.command(range="1A", channel=1)
        block = soem.blocks()[0]
        codes = WaveTable(seed=1).codes(block.count * 20, 20).astype(int)
        codes[:, 3] = np.clip(5 * codes[:, 3], -32768, 32767)
        assert block.ranges == 0b010
        np.testing.assert_array_equal(block.codes, codes)
        double.command(range="5A", channel=1)
        soem.master.slaves[1].sdo_write(0xF800, 1, b"\1")
        assert soem.blocks()[0].ranges == 0b101


def test_al_error_is_acknowledged(pair: tuple[str, str]) -> None:
    with running(pair, terminals=2) as (soem, double):
        double.command(al_error=0x001B, terminal=1)
        assert soem.al_status(1) == (SAFEOP | ACK, 0x001B)
        assert soem.al_status(0)[0] == OP
        slave = soem.master.slaves[2]
        slave.state = OP
        slave.write_state()
        assert soem.al_status(1) == (SAFEOP | ACK, 0x001B)
        slave.state = SAFEOP | ACK
        slave.write_state()
        slave.state = OP
        slave.write_state()
        assert soem.al_status(1) == (OP, 0)


def test_lost_slave_and_cable(pair: tuple[str, str]) -> None:
    with running(pair, terminals=3) as (soem, double):
        double.command(lose_slave=1)
        assert soem.cycle() == 1
        double.command(restore_slave=1)
        assert soem.cycle() == 3
        double.command(cable="out")
        assert soem.cycle(20_000) == -1
        double.command(cable="in")
        assert soem.cycle() == 3


def test_power_cycle_keeps_the_sample_numbers(pair: tuple[str, str]) -> None:
    with running(pair) as (soem, double):
        soem.first_valid()
        for _ in range(50):
            soem.blocks()
        double.command(power_cycle=0)
        assert soem.cycle() == 0
        assert double.stats()["state"] == 1
        soem.configure()
        soem.operate()
        block = soem.first_valid()[0]
        first = double.stats()["last_block_first_sample"]
        assert block.count == 0 and first > 51 * 20
        np.testing.assert_array_equal(block.codes, WaveTable(seed=1).codes(first, 20))


def test_time_passes_while_all_terminals_are_lost(pair: tuple[str, str]) -> None:
    with running(pair) as (soem, double):
        before = soem.first_valid()[0].count
        double.command(lose_slave=0)
        assert [soem.cycle() for _ in range(4)] == 4 * [0]
        double.command(restore_slave=0)
        assert soem.blocks()[0].count == before + 5


def test_advance_shorter_than_a_block_repeats_it(pair: tuple[str, str]) -> None:
    with running(pair, advance_ns=500_000) as (soem, _):
        soem.first_valid()
        counts = [soem.blocks()[0].count for _ in range(20)]
        assert sorted(np.diff(counts).tolist()) in ([0] * 9 + [1] * 10, [0] * 10 + [1] * 9)


def test_namespace_allows_pairs() -> None:
    probe = "from tests.doubles.veth import may_create_veth; print(may_create_veth())"
    done = subprocess.run(namespace_command([sys.executable, "-c", probe]), capture_output=True, text=True, timeout=30)
    if done.returncode:
        pytest.skip(f"no user namespaces: {done.stderr.strip()}")
    assert done.stdout.strip() == "True"


def test_another_terminal_and_bad_commands(pair: tuple[str, str]) -> None:
    with running(pair, operate=False, product=0x0D773052) as (soem, double):
        soem.master.config_init()
        assert soem.master.slaves[1].id == 0x0D773052
        for command in ({"nonsense": 1}, {"al_error": 1, "terminal": 7}, {"dc_drift_ppm": 5}, {"cable": "half"}):
            with pytest.raises(DoubleError):
                double.command(**command)
    with pytest.raises(DoubleError, match="interface"):
        EtherCatDouble("nosuchif0")


KICKCAT = """
import datetime, sys
import kickcat
second = datetime.timedelta(seconds=1)
link = kickcat.create_link(sys.argv[1], "")
link.set_timeout(second / 50)
bus = kickcat.Bus(link)
bus.init(second / 10)
slaves = bus.slaves()
identity = bus.read_sdo(slaves[2], 0x1018, 2, kickcat.Access.PARTIAL, 64, second)
name = bus.read_sdo(slaves[2], 0x1008, 0, kickcat.Access.PARTIAL, 64, second)
bus.create_mapping()
bus.request_state(kickcat.State.SAFE_OP)
bus.wait_for_state(kickcat.State.SAFE_OP, second)
print("RESULT", len(slaves), identity.hex(), name.decode(), [slave.input_size for slave in slaves])
"""


def test_kickcat_reaches_safe_op(pair: tuple[str, str]) -> None:
    pytest.importorskip("kickcat")
    with EtherCatDouble(pair[1], terminals=2):
        for _ in range(3):  # a busy computer may answer after KickCAT's 20 ms, and KickCAT does not repeat a frame
            # A process of its own: KickCAT keeps the interpreter's lock while it waits, and prints at the end.
            done = subprocess.run([sys.executable, "-c", KICKCAT, pair[0]], capture_output=True, text=True, timeout=30)
            result = next((line for line in done.stdout.splitlines() if line.startswith("RESULT")), done.stderr)
            if result.startswith("RESULT"):
                break
    assert result == "RESULT 3 5230c70e EL3783 [0, 32, 32]"


def test_tshark_decodes_every_frame(pair: tuple[str, str], tmp_path: Path) -> None:
    tshark = shutil.which("tshark")
    if tshark is None:
        pytest.skip("tshark is not installed")
    file = tmp_path / "segment.pcap"
    capture = subprocess.Popen(
        [tshark, "-i", pair[0], "-F", "pcap", "-w", str(file)], stderr=subprocess.PIPE, text=True
    )
    assert capture.stderr is not None
    while "Capturing on" not in capture.stderr.readline():
        assert capture.poll() is None, "tshark cannot capture here"
    time.sleep(0.5)
    with running(pair, terminals=2) as (soem, _):
        soem.first_valid()
    time.sleep(0.5)
    capture.terminate()
    capture.wait(10)
    lines = {name: _selected(tshark, file, name) for name in ("ecat", "!ecat", "_ws.malformed", "ecat.cmd == 12")}
    assert lines["ecat"] > 1000 and lines["ecat.cmd == 12"] > 100
    assert lines["!ecat"] == lines["_ws.malformed"] == 0


def _selected(tshark: str, file: Path, expression: str) -> int:
    done = subprocess.run([tshark, "-r", str(file), "-Y", expression], capture_output=True, text=True, check=True)
    return len(done.stdout.splitlines())
