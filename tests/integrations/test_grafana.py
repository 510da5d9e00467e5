"""The dashboard: made by its generator, and every query answered by a real PostgreSQL and a real Prometheus."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import shutil
import subprocess
import sys
import urllib.parse
import urllib.request
from fractions import Fraction
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import numpy as np
import pytest

from acqd.daemon.health.metrics import CONTENT_TYPE, metrics
from acqd.daemon.health.snapshot import Cycles, Delivery, Link, Snapshot
from acqd.energy.quarters import Quarters
from acqd.energy.tariff import Tariff
from acqd.sidecar.store import Done, Store
from acqd.storage.database import open_database, transaction
from acqd.storage.maintain import Retention, maintain
from acqd.storage.rows import insert
from acqd.telemetry.broker import free_port
from acqd.telemetry.row import PowerRow
from acqd.timestamps import filetime, rfc3339
from tests.integrations.grafana import DASHBOARD, panels, sql
from tests.places import ROOT
from tests.waiting import wait_for

BEGIN = 1_790_000_100 // 900 * 900
SPANS = [(BEGIN, BEGIN + 600), (BEGIN - 3600, BEGIN + 3600)]


@pytest.mark.skipif(importlib.util.find_spec("grafana_foundation_sdk") is None, reason="needs acqd[grafana]")
def test_the_committed_dashboard_is_what_the_generator_makes():
    code = "from tools.grafana.__main__ import made; print(made(), end='')"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout == DASHBOARD.read_text(), done.stderr


@pytest.fixture
def filled(postgres):
    """Rows of half an hour, one every 10 s, roll-ups and a prediction."""
    engine = open_database(postgres)
    rows = [
        PowerRow("cell", channel, "b", k, rfc3339((BEGIN + 10 * k) * 10**9), filetime((BEGIN + 10 * k) * 10**9),
                 230.0, 1.0, 100.0 + k, 200.0, 0.5, 50.0, 0.01 * k, ["late"] if k == 3 else [])
        for k in range(180) for channel in ("L1", "total")
    ]  # fmt: skip
    with transaction(engine) as connection:
        insert(connection, rows)
    maintain(engine, Retention(0, 0, 0))
    tariff = Tariff("works", price=Fraction(1, 2))
    quarters = Quarters(lambda: tariff, lambda: BEGIN + 1800.0)
    assert quarters.update(engine) == 2 and quarters.update(engine) == 0
    stamps = np.array([filetime((BEGIN + 10 * k) * 10**9) for k in range(20)])
    Store(engine, "cell").commit(Done("a", "a.log", "m", "ok", {}, stamps, np.full(20, 5.0), np.full(20, 4.0)), {})
    return engine


def test_every_sql_query_is_answered_by_postgresql(filled):
    with filled.connect() as connection:
        for begin, end in SPANS:
            for panel in panels():
                for target in panel["targets"]:
                    if "rawSql" not in target:
                        continue
                    query = sql(target["rawSql"], begin, end, device="'cell'", channel="'L1','total'")
                    answer = connection.exec_driver_sql(query).mappings().all()
                    assert answer, f"{panel['title']}: {query}"
                    assert panel["type"] == "stat" or next(iter(answer[0])) == "time"
        by_title = {panel["title"]: panel["targets"][0].get("rawSql") for panel in panels()}
        energy = sql(by_title["Energy in this span"], *SPANS[1], device="'cell'")
        assert connection.exec_driver_sql(energy).scalar() == pytest.approx(0.9)
        cost = sql(by_title["Cost in this span"], *SPANS[1], device="'cell'")
        assert connection.exec_driver_sql(cost).scalar() == pytest.approx(0.5 * 1.79)
        power = sql(by_title["Power"], *SPANS[0], device="'cell'", channel="'L1'")
        assert [row[2] for row in connection.exec_driver_sql(power)] == [100.0 + k for k in range(61)]
        devices = json.loads(DASHBOARD.read_text())["templating"]["list"][0]["query"]
        assert connection.exec_driver_sql(devices).scalars().all() == ["cell"]


@contextlib.contextmanager
def scraped():
    """Port of an endpoint with acqd's metrics."""
    snapshot = Snapshot(
        "daemon", "cell", "1", 1.0, True, rows=7, delivery=Delivery(spool_bytes=1, spool_limit_bytes=2),
        cycles=Cycles(), broker=Link(connected=True), synchronised=True,
    )  # fmt: skip

    class Page(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", CONTENT_TYPE)
            self.end_headers()
            self.wfile.write(metrics(snapshot))

        def log_message(self, *_):
            return

    with ThreadingHTTPServer(("127.0.0.1", 0), Page) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_port
        server.shutdown()


@pytest.mark.skipif(shutil.which("prometheus") is None, reason="needs prometheus (Debian: prometheus)")
def test_every_expression_has_an_answer_in_prometheus(tmp_path):
    port = free_port()
    with scraped() as target:
        config = (ROOT / "config" / "prometheus" / "prometheus.yml").read_text().replace("9731", str(target))
        config = config.replace("15s", "100ms").replace("[acqd-alerts.yml]", "[]")
        (tmp_path / "p.yml").write_text(config)
        command = ["prometheus", f"--config.file={tmp_path}/p.yml", f"--storage.tsdb.path={tmp_path}/data"]
        with subprocess.Popen(
            [*command, f"--web.listen-address=127.0.0.1:{port}"], stderr=subprocess.DEVNULL
        ) as prometheus:
            try:
                expressions = [target["expr"] for panel in panels() for target in panel["targets"] if "expr" in target]
                assert len(expressions) == 6
                for expression in expressions:
                    wait_for(lambda text=expression: answered(port, text), expression)
            finally:
                prometheus.terminate()


def answered(port, expression):
    query = urllib.parse.urlencode({"query": expression.replace("$__rate_interval", "10s")})
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/v1/query?{query}", timeout=5) as answer:
            found = json.load(answer)
    except OSError:
        return False
    assert found["status"] == "success"
    return found["data"]["result"]
