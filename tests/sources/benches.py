"""The bench of each kind of source."""

from __future__ import annotations

import threading
from contextlib import ExitStack

import numpy as np

from acqd.sources.ads import AdsSettings, AdsSource
from acqd.sources.ethercat import EthercatSettings, EthercatSource
from acqd.sources.modbus import BridgeSettings, BridgeSource, ModbusLink
from acqd.sources.sampled_values import SampledValuesSettings, SampledValuesSource
from tests.doubles.ads import AdsDouble, Settings, unused_host
from tests.doubles.ethercat.control import EtherCatDouble
from tests.doubles.modbus import ModbusTcpDouble, WaveformBridge
from tests.doubles.sampled_values import MergingUnitProcess, SvWave
from tests.doubles.veth import veth_pair
from tests.doubles.waveform import WaveTable
from tests.sources.bench import Bench, wait_until_reachable


class EthercatBench(Bench):
    source: EthercatSource
    step_samples = 20
    oversampling = 20
    advance_ns: int | None = None
    keeps_count = False  # the distributed clock is set again

    def build(self, stack: ExitStack) -> None:
        near, far = stack.enter_context(veth_pair("acqdtst"))
        self.double = stack.enter_context(EtherCatDouble(far, clock="lockstep", advance_ns=self.advance_ns))
        # A busy machine may keep the double from the CPU for a while; that is not what is tested here.
        settings = EthercatSettings(near, oversampling=self.oversampling, receive_us=3_000_000)
        self.source = EthercatSource(settings, self.clock)
        self.wave = WaveTable(seed=1)

    def codes(self, first: int, count: int) -> np.ndarray:
        return self.wave.codes(first, count)

    def lose(self) -> int:
        self.double.command(drop_blocks=7)
        return 7 * self.oversampling

    def over_range(self, on: bool) -> None:
        self.double.command(overrange=0 if on else None)

    def disconnect(self) -> None:
        self.double.command(cable="out")
        self._be_impatient()

    def pass_time(self, seconds: float) -> None:
        self.clock.now += round(seconds * 1e9)

    def reconnect(self) -> None:
        self.double.command(cable="in")

    def restart(self) -> None:
        self._be_impatient()
        self.double.command(power_cycle=0)

    def _be_impatient(self) -> None:
        """What does not come is not waited for as long as what comes late."""
        assert self.source._segment is not None
        self.source._segment._receive_us = 2_000


class AdsBench(Bench):
    source: AdsSource
    step_samples = 400

    def build(self, stack: ExitStack) -> None:
        host = unused_host()
        self.double = stack.enter_context(AdsDouble(Settings(host=host, clock="lockstep")))
        self.source = AdsSource(AdsSettings(host, f"{host}.1.1"), self.clock)
        self.missed = 0  # slots that the PLC filled while nobody read the head, which is what moves its clock

    def codes(self, first: int, count: int) -> np.ndarray:
        return self.double.wave.codes(first, count)

    def lose(self) -> int:
        self.double.command(skip_slots=5)
        return 5 * 20

    def over_range(self, on: bool) -> None:
        self.double.command(status=2 if on else 0, channel=1)

    def disconnect(self) -> None:
        self.double.command(refuse_s=60.0, reset=True)

    def advance(self) -> None:
        super().advance()
        if self.source._client is None:
            self._miss(20)

    def _miss(self, slots: int) -> None:
        self.missed += slots
        self.double.command(advance=20 + self.missed)

    def pass_time(self, seconds: float) -> None:
        self.clock.now += round(seconds * 1e9)
        self._miss(round(seconds * 1000))

    def reconnect(self) -> None:
        self.double.command(refuse_s=0.0)
        wait_until_reachable(self.double.settings.host, 48_898)
        self.until(lambda: self.source.health().connected)
        self.double.command(advance=20)

    def restart(self) -> None:
        self.double.command(restart=True)


class BridgeBench(Bench):
    source: BridgeSource
    step_samples = 400

    def build(self, stack: ExitStack) -> None:
        self.bridge = WaveformBridge(WaveTable(), clock="lockstep")
        self.double = stack.enter_context(ModbusTcpDouble({1: self.bridge}))
        # Two connections: the double's thread shares the interpreter with them.
        link = ModbusLink("127.0.0.1", self.double.port, timeout_s=2.0)
        self.source = BridgeSource(BridgeSettings(link, connections=2), self.clock)

    def codes(self, first: int, count: int) -> np.ndarray:
        return self.bridge.table.codes(first, count)

    def advance(self) -> None:
        super().advance()
        if self.source._client is None:  # nobody reads the header, which is what moves the bridge's clock
            self.bridge._clock._steps += 20

    def lose(self) -> int:
        self.bridge.skip(5)
        return 5 * 20

    def over_range(self, on: bool) -> None:
        if on:
            self.bridge.mark(1, 60)

    def disconnect(self) -> None:
        self.double.refuse(60.0)
        self.double.reset_connections()

    def pass_time(self, seconds: float) -> None:
        self.clock.now += round(seconds * 1e9)
        self.bridge._clock._steps += round(seconds * 1000)

    def reconnect(self) -> None:
        self.double.refuse(0.0)
        wait_until_reachable("127.0.0.1", self.double.port)

    def restart(self) -> None:
        self.bridge.restart()


class SampledValuesBench(Bench):
    step_samples = 48
    search = 48_000

    def build(self, stack: ExitStack) -> None:
        near, far = stack.enter_context(veth_pair("acqdtst"))
        self.double = stack.enter_context(MergingUnitProcess(far, rate=4800, asdus=2, clock="burst", svid="MU0101"))
        # With the APPID the source waits no longer than until it hears the stream.
        settings = SampledValuesSettings(near, svid="MU0101", appid=0x4000, rate=4800.0)
        self.source = SampledValuesSource(settings, self.clock)
        self.wave = SvWave(4800)

    def connect(self) -> None:
        """Publish while the source listens."""
        done = threading.Event()

        def publish() -> None:
            while not done.wait(0.02):
                self.double.burst(1)

        publisher = threading.Thread(target=publish)
        publisher.start()
        try:
            self.source.connect()
        finally:
            done.set()
            publisher.join()

    def codes(self, first: int, count: int) -> np.ndarray:
        return self.wave.codes(first, count)

    def advance(self) -> None:
        super().advance()
        self.double.burst(self.step_samples // 2)

    def lose(self) -> int:
        self.double.command(drop=6)
        return 6 * 2

    def over_range(self, on: bool) -> None:
        self.double.command(quality=8 if on else 0, channel=0)

    def disconnect(self) -> None:
        return  # by `pass_time`, whose frames do not reach the wire

    def pass_time(self, seconds: float) -> None:
        self.clock.now += round(seconds * 1e9)
        self.double.command(pause_s=seconds)
        frames = round(seconds * 2400)
        for sent in range(0, frames, 4800):  # in pieces, each of which is answered soon on any machine
            self.double.burst(min(4800, frames - sent))
        self.source.exchange()  # nothing has come

    def reconnect(self) -> None:
        return

    def restart(self) -> None:
        self.double.command(restart=True)


KINDS: dict[str, type[Bench]] = {
    "ethercat": EthercatBench,
    "ads": AdsBench,
    "modbus": BridgeBench,
    "sampled-values": SampledValuesBench,
}
