"""Rows from RMS meters: the values come from registers, nothing is metered here."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from acqd.daemon.boot import Boot
from acqd.daemon.bus_supervisor import BusSupervisor
from acqd.daemon.feed import Deliver
from acqd.daemon.health.snapshot import FeedHealth, SourceLink
from acqd.daemon.modbus_sections import MetersSection
from acqd.daemon.tally import Tally
from acqd.errors import UserError
from acqd.metering.power import effective
from acqd.plc.kernel_clock import KernelClock, WallClockSteps
from acqd.plc.recent import SampledWindow
from acqd.sources.spec import device_module
from acqd.telemetry.row import CHANNELS, Channel, PowerRow
from acqd.telemetry.summary import Summariser, TimedRow
from acqd.telemetry.topics import valid_device
from acqd.timestamps import filetime, rfc3339

if TYPE_CHECKING:  # needs acqd[hw], which a PC without hardware does not have
    from acqd.sources.meters import MeterBus, Reading

_log = logging.getLogger(__name__)
_STALE_PERIODS = 5
_LOOK_S = 0.2
_RELAUNCHING_S = 60.0  # without a row although the bus was relaunched: then the whole process may be at fault


class MeterFeed:
    """The meters of one link."""

    def __init__(self, source: MetersSection, boot: str, deliver: Deliver, of: str = "") -> None:
        """`of` names the meters in the log where there are several links.

        Raises UserError for a meter name that is invalid or occurs twice.
        """
        names = [meter.name for meter in source.meters]
        for name in names:
            if names.count(name) > 1:
                raise UserError(f"source.meters: two meters have the name {name!r}; it is the device of their rows")
            if not valid_device(name):
                raise UserError(f"source.meters: name {name!r}: expected letters, digits, dots, dashes, underscores")
        meters, modbus = device_module("meters"), device_module("modbus")
        settings = [meters.MeterSettings(**meter.model_dump()) for meter in source.meters]
        self._bus: MeterBus = meters.MeterBus(modbus.ModbusLink(**source.link()), settings)
        self._supervisor = BusSupervisor(self._bus, self._hand_over, of)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._boot = Boot(boot)
        self._clock, self._steps = KernelClock(), WallClockSteps()
        self._simulated = source.simulated
        self._deliver, self._tally = deliver, Tally()
        self._summarisers = {name: Summariser() for name in names}
        self._stopped = asyncio.Event()
        self._last_row = time.monotonic()
        self._troubles: dict[str, str] = {}
        self._found = 0  # times a lost meter came back
        self.refused: list[str] = []

    async def start(self) -> None:
        """Read every meter once. Raises UserError when none answers or one makes no sense."""
        await asyncio.to_thread(self._bus.check)
        self._loop = asyncio.get_running_loop()
        self._supervisor.start()

    async def run(self) -> None:
        """Watch bus and meters until `stop` is called."""
        while not self._stopped.is_set():
            self._watch()
            self._supervisor.watch()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stopped.wait(), _LOOK_S)

    async def stop(self) -> None:
        """End the bus after the reading in progress."""
        if not self._stopped.is_set():
            self._stopped.set()
            await asyncio.to_thread(self._bus.stop)

    def close(self) -> None:
        """Nothing to release after `stop`."""
        return

    def save(self) -> None:
        """Nothing to save: the meters keep their energy registers."""
        return

    def alive(self) -> bool:
        """Whether rows arrive, every meter is known to be lost and the bus keeps trying, or it is being relaunched."""
        longest_s = max(meter.period_ns for meter in self._bus.meters) * 1e-9
        patience_s = _STALE_PERIODS * longest_s + (_RELAUNCHING_S if self._supervisor.trouble else 2.0)
        if time.monotonic() - self._last_row < patience_s:
            return True
        return self._bus.polling and all(meter.trouble for meter in self._bus.meters)

    def window(self, device: str) -> tuple[str, SampledWindow | None] | None:
        """Name of a meter, and None: registers have no samples. None for another name."""
        names = list(self._summarisers)
        return (device or names[0], None) if device in ("", *names) else None

    def health(self) -> FeedHealth:
        """Connected while the bus runs and a meter answers; `trouble` names the bus, or the meters that are silent."""
        silent = {meter.settings.name: meter.trouble for meter in self._bus.meters if meter.trouble}
        ended = self._supervisor.trouble
        trouble = f"meter bus: {ended}" if ended else "; ".join(f"meter {name}: {why}" for name, why in silent.items())
        connected = not ended and len(silent) < len(self._bus.meters)
        source = SourceLink(connected, self._found + self._supervisor.restarts, trouble)
        age = time.monotonic() - self._last_row
        windows = self._tally.total()
        return FeedHealth(self._boot.name, source, age, synchronised=self._clock.synchronised, windows=windows)

    def capture(self, device: str, seconds: float) -> None:
        """Meters that are read have no samples."""

    def status(self) -> dict[str, Any]:
        """Profile, unit and trouble of each meter; launches of the bus after the first."""
        return {
            "simulated": self._simulated,
            "bus": {"restarts": self._supervisor.restarts, "trouble": self._supervisor.trouble},
            "meters": {
                meter.settings.name: {
                    "profile": meter.profile.name,
                    "unit": meter.unit,
                    "trouble": meter.trouble,
                    "remarks": list(meter.remarks),
                }
                for meter in self._bus.meters
            },
        }

    def _watch(self) -> None:
        """Log when a meter is lost or comes back, not while that lasts."""
        for meter in self._bus.meters:
            name, trouble = meter.settings.name, meter.trouble
            before = self._troubles.get(name, "")
            self._troubles[name] = trouble
            if trouble and not before:
                _log.warning("meter %s: %s; trying again", name, trouble)
            elif before and not trouble:
                self._found += 1
                _log.warning("meter %s is back; the gap is flagged", name)

    def _hand_over(self, reading: Reading) -> None:
        """From the thread of the bus to the event loop."""
        assert self._loop is not None
        self._loop.call_soon_threadsafe(self._take, reading)

    def _take(self, reading: Reading) -> None:
        self._supervisor.delivered()
        flags = reading.flags | self._clock.flags() | ({"simulated"} if self._simulated else set())
        if self._steps.stepped(time.time_ns(), time.monotonic_ns()):
            flags |= {"clock_step"}
        timed = list(_timed_rows(reading, self._boot.name, sorted(flags)))
        self._boot.stamp([entry.row for entry in timed])
        summaries = self._summarisers[reading.meter].add_rows(timed)
        rows = [entry.row for entry in timed]
        self._tally.add(rows)
        self._deliver(rows, summaries, None)  # the meters keep their registers
        self._last_row = time.monotonic()


def _timed_rows(reading: Reading, boot: str, flags: list[str]) -> Iterator[TimedRow]:
    """Rows of the meter's phases, and their total where there is more than one phase."""
    channels: list[Channel] = list(CHANNELS[: reading.phases])
    if reading.phases > 1:
        channels.append("total")
    stamp, ticks = rfc3339(reading.utc_ns), filetime(reading.utc_ns)
    for channel in channels:
        values = _channel(reading, channel)
        row = PowerRow(
            reading.meter,
            channel,
            boot,
            reading.seq,
            stamp,
            ticks,
            values["Vrms"],
            values["Irms"],
            values["P"],
            values["S"],
            values["PF"],
            reading.values.get("f") or None,  # 0 Hz: the meter does not measure it
            _net(reading, channel),
            flags,
        )
        yield TimedRow(row, reading.utc_ns, values["W"], values["W_export"])


def _channel(reading: Reading, channel: Channel) -> dict[str, float | None]:
    """Quantities of a channel: from its registers, or computed from other registers of the same round."""
    names = ("Vrms", "Irms", "P", "S", "PF", "W", "W_export")
    values = {name: reading.values.get(f"{channel}.{name}") for name in names}
    if channel == "total":
        for name in ("Vrms", "Irms"):
            phases = [reading.values.get(f"L{k + 1}.{name}") for k in range(reading.phases)]
            known = [value for value in phases if value is not None]
            values[name] = effective(known) if len(known) == len(phases) else None
    if values["S"] is None:
        values["S"] = _apparent(reading, channel)
    values["PF"] = _power_factor(values["PF"], values["P"], values["S"])
    return values


def _power_factor(register: float | None, P: float | None, S: float | None) -> float | None:
    """Signed as P: the sign of a meter's register may say inductive or capacitive instead."""
    if P is None:
        return None
    if register is None:
        return P / S if S else None
    return math.copysign(register, P) if P else abs(register)


def _apparent(reading: Reading, channel: Channel) -> float | None:
    """Apparent power [VA]: Vrms x Irms of a phase; for the total, the sum over the phases."""
    if channel == "total":
        parts = [_channel(reading, phase)["S"] for phase in CHANNELS[: reading.phases]]
        return None if None in parts else sum(part for part in parts if part is not None)
    volts, amperes = reading.values.get(f"{channel}.Vrms"), reading.values.get(f"{channel}.Irms")
    return None if volts is None or amperes is None else volts * amperes


def _net(reading: Reading, channel: Channel) -> float | None:
    """Imported minus exported energy; null while the meter cannot say one of them."""
    imported, exported = reading.values.get(f"{channel}.W"), reading.values.get(f"{channel}.W_export", 0.0)
    return None if imported is None or exported is None else imported - exported
