"""The watchdog of systemd."""

from __future__ import annotations

import threading
import time

import pytest

from acqd.daemon.health.watchdog import Watchdog, interval_s
from tests.waiting import LIMIT_S, wait_for


@pytest.fixture(autouse=True)
def unit(monkeypatch):
    monkeypatch.setenv("WATCHDOG_USEC", "150000")


def test_it_is_fed_while_this_thread_is_blocked_and_only_while_the_service_is_alive():
    sent, alive, often = [], True, threading.Event()

    def send(message):
        sent.append(message)
        if len(sent) > 2:
            often.set()

    dog = Watchdog(lambda: alive, send)
    dog.start()
    assert often.wait(LIMIT_S)  # a call that blocks
    assert set(sent) == {"WATCHDOG=1"}
    alive = False
    count = len(sent)
    time.sleep(0.3)
    assert len(sent) <= count + 1
    alive = True
    wait_for(lambda: len(sent) > count + 2, "fed again")
    dog.stop()


@pytest.mark.parametrize(("usec", "seconds"), [("15000000", 5.0), ("", 5.0), ("nonsense", 5.0), ("3000000", 1.0)])
def test_it_is_fed_three_times_as_often_as_the_unit_asks(usec, seconds, monkeypatch):
    monkeypatch.setenv("WATCHDOG_USEC", usec)
    assert interval_s() == pytest.approx(seconds)
