"""The live page in a browser, with a real broker and database."""

from __future__ import annotations

import threading
import time

import paho.mqtt.client as paho
import pytest

from acqd.daemon.energy_section import EnergySection
from acqd.daemon.health.section import HealthSection
from acqd.storage.database import open_database
from acqd.storage.writer import Writer
from acqd.telemetry.broker import free_port
from acqd.telemetry.mqtt import BrokerAddress
from acqd.web.settings import WebSettings
from tests.browser import chromium, looks, serious_findings
from tests.storage.rows import message, row
from tests.waiting import LIMIT_S

pytestmark = pytest.mark.browser
pytest.importorskip("uvicorn")
_PATIENCE_MS = 60_000
_HEALTH = HealthSection(port=0, sink_port=0)


class Served:
    """`acqd web` in a thread."""

    def __init__(self, settings):
        from acqd.web.server import Server

        self.server = Server(settings)
        self.thread = threading.Thread(target=self.server.run)
        self.thread.start()

    def stop(self):
        self.server.end()
        self.thread.join(LIMIT_S)


@pytest.fixture
def publisher(mosquitto):
    client = paho.Client(paho.CallbackAPIVersion.VERSION2)
    client.connect("127.0.0.1", mosquitto.port)
    client.loop_start()
    yield client
    client.disconnect()
    client.loop_stop()


def send(client, seq, P, age_s=0.04, **changes):
    sent = row(seq, t=time.time() - age_s, P=P, **changes)
    client.publish(f"acqd/{sent.device}/L1/power", sent.to_json()).wait_for_publish(LIMIT_S)
    return sent


def sends_until(page, selector, text, send_one):
    """Send rows until the page says `text`: it says so while rows arrive."""
    for _ in range(600):
        send_one()
        if text in page.inner_text(selector):
            return
        time.sleep(0.1)
    raise AssertionError(page.inner_text(selector))


def shows(page, selector, text):
    from playwright.sync_api import expect

    expect(page.locator(selector).first).to_contain_text(text, timeout=_PATIENCE_MS)


def shows_no_more(page, selector, text):
    """Without wait_for_function: where the page makes it wait, it evaluates a text, which the page's policy forbids."""
    from playwright.sync_api import expect

    expect(page.locator(selector).first).not_to_contain_text(text, timeout=_PATIENCE_MS)


def past_by_keyboard(page):
    """The values of the course, and from live to the past and back, without a mouse."""
    page.focus("#chart")
    for key, said in (("End", ": L1 123.46"), ("Home", ": L1 77")):
        page.keyboard.press(key)
        shows(page, "#chart + output", said)
    page.focus("#earlier")
    page.keyboard.press("Enter")
    shows(page, "#summary", "from power")
    shows_no_more(page, "#summary", "live")
    assert "end=" in page.get_attribute("#csv", "href") and page.input_value("#to")
    page.focus("#live")
    page.keyboard.press("Enter")
    shows(page, "#summary", "then live")
    assert "end=" not in page.get_attribute("#csv", "href")


def test_numbers_are_those_of_the_rows_and_come_back_after_a_restart(mosquitto, publisher, tmp_path):
    database = str(tmp_path / "power.sqlite")
    begun = time.time()
    engine = open_database(database)
    Writer(engine).write([message(row(k, t=begun - 30 + 0.04 * k, P=77.0)) for k in range(100)])
    (tmp_path / "tariff.toml").write_text("price = 0.5\n")
    energy = EnergySection(tariff=tmp_path / "tariff.toml")
    broker = BrokerAddress("127.0.0.1", mosquitto.port)
    settings = WebSettings(broker, database, _HEALTH, port=free_port(), energy=energy)
    served = Served(settings)
    try:
        with chromium() as browser:
            page = next(looks(browser))
            page.goto(settings.address)
            shows(page, "#summary", "most 77.0")
            shows(page, "#state", "waiting")
            sends_until(page, "#state", "catching up, 6", lambda: send(publisher, 7, 55.0, age_s=63.0, boot="earlier"))
            shows(page, "#now", " s ago")
            sent = send(publisher, 1000, 123.456)
            shows(page, "[data-of=P]", "123.5")
            assert page.get_attribute("#big", "data-seq") == str(sent.seq)
            send(publisher, 8, 56.0, age_s=62.0, boot="earlier")  # the rest of the backlog
            sends_until(page, "#now", "Now", lambda: send(publisher, 1001, 123.456))
            assert page.get_attribute("#big", "data-seq") == "1001"
            shows(page, "#summary", "most 123.5")
            shows(page, "[data-energy=today] + span", "Wh")
            shows(page, "#cost-now", "0.0617 EUR/h")  # 123.456 W at 0.5 EUR/kWh
            shows(page, "#against-of", "no rows of last week")
            past_by_keyboard(page)
            send(publisher, 5, 10.0, device="press")
            publisher.publish("acqd/press/status", b"offline")
            shows(page, "#fleet tr:has-text('press')", "offline")
            page.click("#fleet button:has-text('press')")
            shows(page, "#device", "press")
            page.click(f"#fleet button:has-text('{sent.device}')")
            assert page.errors == []
            served.stop()
            served = Served(settings)
            for seq in range(1002, 1602):  # until the browser has connected again
                send(publisher, seq, 200.31)
                if page.inner_text("[data-of=P]") == "200.3":
                    break
                time.sleep(0.1)
            shows(page, "[data-of=P]", "200.3")
            for view in looks(browser):
                view.goto(settings.address)
                shows(view, "#device", sent.device)
                assert serious_findings(view) == [] and view.errors == []
    finally:
        served.stop()
