"""Rows in line protocol: in a real InfluxDB, and through its absence."""

from __future__ import annotations

import json
import shutil
import subprocess
import tomllib
import urllib.parse
import urllib.request

import pytest
from msgspec import structs

from acqd.integrations.influx import Influx
from acqd.integrations.influx_lines import event_line, line, quality_line
from acqd.telemetry.broker import free_port
from acqd.telemetry.event import parse_event
from acqd.telemetry.quality_row import parse_quality
from acqd.telemetry.row import PowerRow
from acqd.timestamps import utc_ns
from tests.integrations.messages import event, quality
from tests.places import ROOT
from tests.storage.rows import T0, row
from tests.waiting import wait_for


def take(bridge, sent):
    bridge.take(f"acqd/{sent.device}/{sent.channel}/power", sent.to_json())


def test_line_of_a_row():
    sent = structs.replace(row(7, P=1.5, PF=None), device="hall 3,a=b", flags=["gap", 'od"d'])
    text = line(sent)
    assert text.startswith(f"power,device=hall\\ 3\\,a\\=b,channel={sent.channel} ")
    assert "P=1.5" in text and "PF=" not in text and ",seq=7i," in text and 'flags="gap od\\"d"' in text
    assert text.endswith(f" {utc_ns(sent.filetime)}")


def test_lines_of_power_quality_and_of_an_event():
    text = quality_line(parse_quality(quality()[1]))
    assert text.startswith("power_quality,device=cell1,channel=L1,aggregation=150/180 ")
    assert "V_thds=2.5" in text and "V_h1=230.0" in text and "V_h3=5.0" in text and "V_h2=" not in text
    assert 'flags="simulated"' in text and ",intervals=15i," in text and "rocof" not in text
    begun, ended = (event_line(parse_event(event(duration)[1])) for duration in (None, 0.1))
    assert begun.startswith("power_event,device=cell1,kind=dip ") and "duration=" not in begun
    assert "duration=0.1" in ended and begun.rpartition(" ")[2] == ended.rpartition(" ")[2]


def test_power_quality_is_passed_on_from_the_aggregation_that_is_set():
    for setting, lines in (("10/12", 2), ("150/180", 1), ("off", 0)):
        bridge = Influx("http://127.0.0.1:1/write", quality=setting)
        for message in (
            quality(),
            quality(aggregation="10/12"),
            (quality()[0], b"{}"),
            ("acqd/other/event", event()[1]),
        ):
            bridge.take(*message)
        assert bridge._lines.qsize() == lines
        assert ("acqd/+/+/quality" in bridge.subscriptions()) == (setting != "off")


def test_what_is_no_row_or_of_another_topic_is_left_out():
    bridge = Influx("http://127.0.0.1:1/write")
    sent = row(1)
    bridge.take("acqd/other/L1/power", sent.to_json())
    for payload in (b"{}", b"", b"[]", b"null"):
        bridge.take(f"acqd/{sent.device}/L1/power", payload)
    bridge.take("acqd/other/window", b"[" + sent.to_json() + b"]")
    assert bridge._lines.empty()
    take(bridge, sent)
    bridge.take(f"acqd/{sent.device}/window", b"[" + sent.to_json() + b"," + row(1, "L2").to_json() + b"]")
    assert bridge._lines.qsize() == 3


def test_rows_that_do_not_fit_are_counted():
    bridge = Influx("http://127.0.0.1:1/write", waiting=2)
    for seq in range(5):
        take(bridge, row(seq))
    assert bridge.dropped == 3


@pytest.mark.skipif(shutil.which("influxd") is None, reason="needs influxd (Debian: influxdb)")
def test_a_real_influxdb_has_every_row_also_those_from_before_its_start(tmp_path):
    http, rpc = free_port(), free_port()
    base = f"http://127.0.0.1:{http}"
    config = tmp_path / "influx.toml"
    config.write_text(
        f'reporting-disabled = true\nbind-address = "127.0.0.1:{rpc}"\n[meta]\ndir = "{tmp_path}/meta"\n'
        f'[data]\ndir = "{tmp_path}/data"\nwal-dir = "{tmp_path}/wal"\n'
        f'[http]\nbind-address = "127.0.0.1:{http}"\nlog-enabled = false\n[monitor]\nstore-enabled = false\n'
    )
    with Influx(f"{base}/write?db=acqd&precision=ns") as bridge:
        for seq in range(100):
            take(bridge, row(seq, t=T0 + seq, P=float(seq)))
        for message in (quality(), quality(t=T0 + 3, V_thds=3.5), event(None), event(0.1)):
            bridge.take(*message)
        with subprocess.Popen(
            ["influxd", "-config", config], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        ) as db:
            try:
                wait_for(lambda: asked(base, "CREATE DATABASE acqd", post=True), "InfluxDB answers")
                wait_for(lambda: bridge.written == 104, "rows are written")
                answer = asked(base, "SELECT count(P), sum(P), max(seq) FROM power GROUP BY device, channel")
                distortion = asked(
                    base, "SELECT mean(V_thds), max(V_h3) FROM power_quality WHERE aggregation='150/180'"
                )
                events = asked(base, 'SELECT extreme, "duration" FROM power_event')
            finally:
                db.terminate()
    (series,) = answer["results"][0]["series"]
    assert series["tags"] == {"device": row(0).device, "channel": row(0).channel}
    assert series["values"][0][1:] == [100, sum(range(100)), 99]
    assert distortion["results"][0]["series"][0]["values"][0][1:] == [3.0, 5.0]
    assert [each[1:] for each in events["results"][0]["series"][0]["values"]] == [[161.0, 0.1]]


def asked(base, query, post=False):
    text = urllib.parse.urlencode({"db": "acqd", "q": query})
    try:
        with urllib.request.urlopen(f"{base}/query?{text}", b"" if post else None, timeout=60) as answer:
            return json.load(answer)
    except OSError:
        return None


def test_telegraf_is_told_the_keys_and_types_of_rows():
    (consumer,) = tomllib.loads((ROOT / "config" / "telegraf" / "acqd.conf").read_text())["inputs"]["mqtt_consumer"]
    (parser,) = consumer["json_v2"]
    types = {entry["path"]: entry["type"] for entry in parser["field"]}
    assert set(types) | {"device", "channel", "time"} <= set(PowerRow.__slots__)
    assert all(types[name] == "float" for name in ("Vrms", "Irms", "P", "S", "PF", "f", "W"))
    assert {entry["path"] for entry in parser["tag"]} == {"device", "channel"} and parser["timestamp_path"] == "time"
