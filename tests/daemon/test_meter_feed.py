"""The feed of RMS meters when the thread that polls them is killed."""

from __future__ import annotations

import asyncio
import ctypes

from acqd.daemon.meter_feed import MeterFeed
from acqd.daemon.modbus_sections import MetersSection
from tests.doubles.modbus import ModbusTcpDouble
from tests.sources.meter_doubles import frozen
from tests.waiting import finish, until


def kill(thread) -> None:
    """Raise SystemExit in a thread: what a bug in a library may do as well."""
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), ctypes.py_object(SystemExit))


def test_a_dead_thread_of_the_bus_is_launched_again_and_metering_goes_on(caplog):
    rows, names = [], ("a", "b")
    meters = [{"name": name, "profile": "em340", "unit": k + 1, "poll_s": 0.05} for k, name in enumerate(names)]

    async def scenario(port):
        section = MetersSection(kind="meters", host="127.0.0.1", port=port, timeout_s=10.0, meters=meters)
        feed = MeterFeed(section, "boot", lambda more, *_: rows.extend(more))
        await feed.start()
        running = asyncio.create_task(feed.run())
        for deaths in (1, 2, 3):
            await until(lambda: {row.device for row in rows} == set(names), "rows of both meters")
            kill(feed._bus._thread)
            await until(lambda: feed.health().source.trouble, "the end of the thread is noticed")
            health, alive = feed.health().source, feed.alive()
            assert not health.connected and "thread ended (SystemExit)" in health.trouble and alive
            rows.clear()
            await until(lambda: rows and not feed.health().source.trouble, "rows again")
            assert feed.health().source.connected and feed.status()["bus"]["restarts"] == deaths
            assert "gap" in rows[0].flags
        assert not running.done()
        await feed.stop()
        await running

    with ModbusTcpDouble({unit: frozen("em340") for unit in (1, 2)}) as double:
        finish(scenario(double.port))
    assert caplog.text.count("relaunching it") == 3 and caplog.text.count("delivers again") == 3


def test_stopping_while_the_bus_is_gone_ends_the_feed(caplog):
    async def scenario(port):
        meters = [{"name": "a", "profile": "em340", "unit": 1, "poll_s": 0.05}]
        feed = MeterFeed(MetersSection(kind="meters", host="127.0.0.1", port=port, meters=meters), "boot", print)
        await feed.start()
        running = asyncio.create_task(feed.run())
        kill(feed._bus._thread)
        await until(lambda: feed.health().source.trouble, "the end of the thread is noticed")
        await feed.stop()
        await running
        assert not feed._bus.polling

    with ModbusTcpDouble({1: frozen("em340")}) as double:
        finish(scenario(double.port))
