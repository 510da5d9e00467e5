"""The embedded broker beside the daemon."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys

import pytest

from acqd.daemon.broker_process import BrokerProcess
from acqd.errors import UserError
from acqd.telemetry.ports import free_port
from tests.waiting import finish, until


def answers(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def test_it_is_another_process_and_comes_back_when_it_is_killed():
    async def scenario():
        port = free_port()
        broker = BrokerProcess("127.0.0.1", port)
        await broker.start()
        first = broker._process.pid
        assert answers(port) and first != os.getpid()
        with pytest.raises(UserError, match=f"{port}.*another"):
            await BrokerProcess("127.0.0.1", port).start()
        broker._process.kill()
        await until(lambda: broker._process.pid != first and answers(port), "the broker is back")
        await broker.stop()
        await asyncio.sleep(0)
        assert not answers(port)

    finish(scenario())


def test_it_ends_with_a_daemon_that_is_killed():
    port = free_port()
    code = (
        "import asyncio, os, signal\nfrom acqd.daemon.broker_process import BrokerProcess\n"
        f"async def daemon():\n    await BrokerProcess('127.0.0.1', {port}).start()\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\nasyncio.run(daemon())"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -signal.SIGKILL

    async def scenario():
        await until(lambda: not answers(port), "the broker is gone")

    finish(scenario())
