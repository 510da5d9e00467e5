"""Waveform, prediction, arm, health and report of the live page in a browser."""

from __future__ import annotations

import json
import time

import numpy as np
import orjson
import pytest

from acqd.daemon.health.section import HealthSection
from acqd.daemon.health.server import HealthServer
from acqd.daemon.health.snapshot import BoxHealth, Cycles, SourceLink, Windows
from acqd.daemon.health.window import WINDOW, window_page
from acqd.daemon.web_section import WebSection
from acqd.metering import StreamFormat
from acqd.plc.distribution import Durations
from acqd.plc.recent import SampledWindow
from acqd.sidecar.store import Done, Store
from acqd.storage.database import open_database
from acqd.telemetry.broker import free_port
from acqd.telemetry.mqtt import BrokerAddress
from acqd.web.settings import WebSettings
from tests.browser import chromium, looks, serious_findings
from tests.daemon.health.snapshots import daemon
from tests.web.test_in_a_browser import Served, publisher, send, sends_until, shows  # noqa: F401 - a fixture

pytestmark = pytest.mark.browser
pytest.importorskip("uvicorn")
_WEIGHT_BYTES = 120_000
_T0 = 134_398_703_195_133_591
_RESULT = {
    "verdict": "effects_found", "before": {"rmse": 25.0}, "after": {"rmse": 1.5}, "next": ["weigh the gripper"],
    "recordings": {"fit": 13, "held_out": 3}, "unexplained": "",
    "effects": [{"id": "payload", "where": "flange", "confidence": 0.97, "added": True,
                 "parameters": {"mass": {"value": 2.04, "unit": "kg", "ci95": [1.9, 2.2]}}}],
}  # fmt: skip


def window_of(device):
    """230 V and 2 A with 15 % of the third harmonic."""
    t = 2 * np.pi * 50 * np.arange(800) / 20_000
    u, i = 230 * np.sqrt(2) * np.sin(t), 2 * np.sqrt(2) * (np.sin(t) + 0.15 * np.sin(3 * t))
    codes = np.column_stack([u / 0.02, i / 0.0003]).round().astype(np.int16)
    return device, SampledWindow(StreamFormat(20_000, (0.02, 0.0003)), 7, 1_763_856_000 * 10**9, codes, frozenset())


def snapshot():
    slow = Durations()
    for us in (80, 300, 300, 1500):
        slow.add(us * 1000)
    cycles = Cycles(60_000, 5, 2, 1, 0, slow.distribution(), slow.distribution())
    windows = Windows(1500, 12, {"gap": 3, "late": 9})
    here = BoxHealth("cell1", ("cell1",), "ads", SourceLink(True, 0, "", 41), windows=windows, cycles=cycles)
    away = BoxHealth("mill", ("mill",), "meters", SourceLink(False, 2, "no answer from 10.0.0.9"), restarts=3)
    return daemon(cycles=cycles, synchronised=False, windows=windows, boxes=(here, away), source=SourceLink(False))


def predict(database):
    """A log whose measured power is 20 W above the predicted."""
    predicted = np.linspace(100, 200, 500)
    message = {"log": "run-1.csv", "begin": "2026-11-23T00:00:00.000Z", "end": "2026-11-23T00:00:20.000Z",
               "rmse_W": 20.0,
               "energy_kWh": 0.001, "energy_predicted_kWh": 0.0009, "drift": "alarm",
               "alarm": {"chart": "level up", "onset_s": 1.76e9, "raised_s": 1.76e9, "log": "run-1.csv"}}  # fmt: skip
    filetimes = _T0 + 400_000 * np.arange(500)
    done = Done("a" * 64, "run-1.csv", "m", "ok", message, filetimes, predicted + 20, predicted)
    Store(open_database(database)).commit(done, {})
    return message["alarm"]


WIRING = {
    "findings": [{"text": "i2 is reversed", "correction": "[source] correction = { i_gain = [1.0, -1.0, 1.0] }"}],
    "phasors": {
        "U": [[230.0, 0.0], [230.0, -120.0], [230.0, 120.0]],
        "I": [[4.0, -31.0], [4.0, 29.0], [4.0, 89.0]],
    },
}


UNWEIGHED = ("/events", "/arm", "/three", "/files", "/values")
"""Loaded later: the arm with a posture, three.js when the arm comes into sight, files where [web] takes them, values of
charts when somebody looks."""


def posture_at(time_s, angle):
    return orjson.dumps({"time": time_s, "q": [0, angle, 0, -1.4, 0, 1.1, 0]})


def in_three_dimensions(page, client, device):
    """The arm in sight, with the prediction of its posture by cause."""
    page.evaluate("document.getElementById('arm').scrollIntoView()")
    shows(page, "#posture .hint", "arrow keys")
    now = time.time()
    said = {
        "time": now,
        "P_predicted": 90.0,
        "causes": {"standby": 60.0, "copper": 30.0},
        "joints": [["copper", 5.0]] * 7,
    }
    client.publish(f"acqd/{device}/prediction/live", orjson.dumps(said))
    client.publish(f"acqd/{device}/joints", posture_at(now, 0.6))
    shows(page, "#posture .layers li:has-text('copper')", "30.0 W")
    assert page.get_attribute("#posture input[type=range]", "aria-valuetext").endswith("predicted 90.0 W")
    page.wait_for_timeout(250)  # postures are drawn five times a second
    client.publish(f"acqd/{device}/joints", posture_at(now - 60, 0.5))  # the sender's clock was set back
    shows(page, "#posture-note", "the flange is 0.59, 0.00, 0.44 m from the base")


@pytest.fixture
def page_of_all(mosquitto, tmp_path):
    health = HealthSection(port=free_port(), sink_port=0)
    server = HealthServer(health.host, health.port, snapshot, {WINDOW: window_page(window_of)})
    server.start()
    result = tmp_path / "loops" / "one"
    result.mkdir(parents=True)
    (result / "report.html").write_text("<title>report</title><script>document.title = 'shown'</script>")
    (result / "report.json").write_text(json.dumps(_RESULT))
    database = str(tmp_path / "power.sqlite")
    alarm = predict(database)
    section = WebSection(robot="iiwa7_r800", reports=tmp_path / "loops", files=True)
    broker = BrokerAddress("127.0.0.1", mosquitto.port)
    served = Served(WebSettings(broker, database, health, port=free_port(), section=section))
    yield served, alarm
    served.stop()
    server.stop()


def a_file_that_a_proxy_refuses(page):
    page.route("**/api/files/add*", lambda route: route.fulfill(status=413, content_type="text/html", body="<html>"))
    page.set_input_files("#files-input", files=[{"name": "a.csv", "mimeType": "text/csv", "buffer": b"1"}])
    shows(page, "#files-note", "client_max_body_size")
    assert page.query_selector("[role=status] #files-seconds") is None  # it would be read aloud every second


def health_of_boxes(page):
    shows(page, "#services", "source of mill away: no answer from 10.0.0.9")
    shows(page, "#boxes tr:has-text('mill')", "away")
    shows(page, "#boxes tr:has-text('cell1')", "12 of 1500")
    shows(page, "#boxes tr:has-text('cell1')", "late 9, gap 3")
    shows(page, "#cycles h3", "MAIN_FAST of cell1")


def charts_by_keyboard(page):
    """The values of every chart without a mouse."""
    for chart, said in (
        ("#wave", "time [ms] 0: voltage "), ("#harmonics", "order 2: voltage "),
        ("#predicted-course", "time in the log [s] 0: measured "),
        ("#residual-course", "time in the log [s] 0: residual 20"),
    ):  # fmt: skip
        page.focus(chart)
        page.keyboard.press("Home")
        shows(page, f"{chart} + output", said)


def test_every_panel_shows_its_data_and_nothing_is_wrong(page_of_all, publisher):  # noqa: F811 - the fixture
    from playwright.sync_api import expect

    served, alarm = page_of_all
    address = served.server._site._settings.address
    with chromium() as browser:
        for page in looks(browser):
            weight = []
            page.on("response", lambda answer, weight=weight: "api" not in answer.url and weight.append(answer))
            light = page.rules is None
            if light:
                page.route("**/arm_live.js", lambda route: route.abort(), times=1)  # asked for again
            page.goto(address)
            shows(page, "#log-table", "run-1.csv")
            sends_until(page, "#device", "cell1", lambda: send(publisher, 7, 123.4))  # a viewer gets what comes later
            sent = send(publisher, 7, 123.4)
            publisher.publish(f"acqd/{sent.device}/prediction/alarm", orjson.dumps(alarm), retain=True)
            publisher.publish(f"acqd/{sent.device}/joints", posture_at(time.time(), 0.5))
            publisher.publish(f"acqd/{sent.device}/status", orjson.dumps({"device": sent.device, "wiring": WIRING}))
            shows(page, "#wiring-findings", "i2 is reversed: [source] correction = { i_gain = [1.0, -1.0, 1.0] }")
            shows(page, "#phasor-table", "149.0")
            page.evaluate("document.getElementById('scope').scrollIntoView()")  # samples are fetched in sight only
            shows(page, "#wave-figures", "15.00")
            shows(page, "#wave-figures", "230.0 V")
            shows(page, "#alarm", "The residual has changed since 2025-10-09")
            shows(page, "#course-note", "residual from 20.0 to 20.0 W")
            shows(page, "#posture-note", "iiwa7_r800: the flange is 0.59, 0.00, 0.44 m from the base")
            assert ["ERR_FAILED" in each for each in page.errors] == [True] * light
            page.errors.clear()
            assert not page.evaluate("'THREE' in window")  # it is loaded when the arm comes into sight
            shows(page, "#report", "A missing effect was found.")
            shows(page, "#report", "mass 2.04 kg (1.9 to 2.2); confidence 97 %")
            shows(page, "#slow", "200 µs to 500 µs")
            shows(page, "#services a", "what to do")
            shows(page, "#wrong", "daemon: source of mill away: no answer from 10.0.0.9 what to do")
            shows(page, "#wrong", f"{sent.device}: residual changed since 2025-10-09")
            assert page.is_hidden("#fast")  # tables for developers are folded
            health_of_boxes(page)
            assert page.is_hidden("#loop-controls")
            shows(page, "#files-section", "drop them on the page")
            charts_by_keyboard(page)
            page.focus("#hold")
            page.keyboard.press("Enter")
            assert page.get_attribute("#hold", "aria-pressed") == "true"
            if light:
                in_three_dimensions(page, publisher, sent.device)
            assert serious_findings(page) == [] and page.errors == []
            bodies = [answer.body() for answer in weight if not any(part in answer.url for part in UNWEIGHED)]
            assert 50_000 < sum(map(len, bodies)) < _WEIGHT_BYTES
            if light:
                a_file_that_a_proxy_refuses(page)
            page.goto(f"{address}report")
            expect(page).to_have_title("shown", timeout=60_000)
