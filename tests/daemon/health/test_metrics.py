"""The metrics as Prometheus reads them."""

from __future__ import annotations

from prometheus_client.parser import text_string_to_metric_families

from acqd.daemon.health.metrics import metrics
from acqd.daemon.health.snapshot import Link
from tests.daemon.health.snapshots import daemon, sink


def samples(snapshot):
    return {
        (sample.name, sample.labels.get("peer", "")): sample.value
        for family in text_string_to_metric_families(metrics(snapshot).decode())
        for sample in family.samples
    }


def test_prometheus_reads_what_the_daemon_counts():
    read = samples(daemon())
    assert read["acqd_rows_total", ""] == 6000 and read["acqd_messages_dropped_total", ""] == 0
    assert read["acqd_spool_bytes", ""] == 2e6 and read["acqd_spool_age_seconds", ""] == 0.4
    assert read["acqd_cycles_late_total", ""] == 5 and read["acqd_cycles_missed_total", ""] == 2
    assert read["acqd_reconnects_total", "source"] == 2 and read["acqd_reconnects_total", "broker"] == 3
    assert read["acqd_last_row_age_seconds", ""] == 0.03 and read["acqd_receipts_outstanding", ""] == 8
    assert read["acqd_alive", ""] == read["acqd_ready", ""] == 1 and read["acqd_connected", "source"] == 1


def test_what_a_service_does_not_have_is_left_out():
    read = samples(sink(last_row_age_s=None, database=Link(False)))
    assert not any(name.startswith(("acqd_cycles", "acqd_spool", "acqd_messages")) for name, _ in read)
    assert ("acqd_last_row_age_seconds", "") not in read and ("acqd_clock_synchronised", "") not in read
    assert read["acqd_connected", "database"] == 0 and read["acqd_ready", ""] == 0 and read["acqd_alive", ""] == 1
