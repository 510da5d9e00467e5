"""A snapshot in the text format of Prometheus; names after its conventions (base units, `_total` for counters)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import accumulate

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from acqd.daemon.health.box_metrics import box_metrics, sources_of
from acqd.daemon.health.snapshot import Cycles, Delivery, Snapshot
from acqd.daemon.health.verdict import verdict

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
_Figures = list[tuple[str, str, float | None]]


def metrics(snapshot: Snapshot) -> bytes:
    """The page /metrics; what this service does not have is left out."""
    registry = CollectorRegistry()
    registry.register(_Once(snapshot))
    return generate_latest(registry)


class _Once(Collector):
    """Hands out the metrics of one snapshot."""

    def __init__(self, snapshot: Snapshot) -> None:
        self._snapshot = snapshot

    def collect(self) -> Iterator[Metric]:
        snapshot = self._snapshot
        labels = {"service": snapshot.service, "name": snapshot.name}
        for name, text, count in _counters(snapshot):
            if count is not None:
                yield _with(CounterMetricFamily(f"acqd_{name}", text, labels=list(labels)), labels, count)
        for name, text, value in _gauges(snapshot):
            if value is not None:
                yield _with(GaugeMetricFamily(f"acqd_{name}", text, labels=list(labels)), labels, value)
        yield from _histograms(snapshot, labels)
        links = {"source": snapshot.source, "broker": snapshot.broker, "database": snapshot.database}
        up = GaugeMetricFamily("acqd_connected", "1 while the peer is connected", labels=[*labels, "peer"])
        again = CounterMetricFamily("acqd_reconnects", "Connections made again", labels=[*labels, "peer"])
        for peer, link in links.items():
            if link is not None:
                up.add_metric([*labels.values(), peer], float(link.connected))
                again.add_metric([*labels.values(), peer], link.reconnects)
        yield from (up, again)
        if snapshot.service == "daemon":
            yield from box_metrics(sources_of(snapshot), labels)


def _histograms(snapshot: Snapshot, labels: dict[str, str]) -> Iterator[Metric]:
    cycles = snapshot.cycles or Cycles()
    for name, text, times in (
        ("main_fast_latency_seconds", "How late MAIN_FAST woke", cycles.latency),
        ("main_slow_duration_seconds", "How long MAIN_SLOW took per wake-up", cycles.slow),
    ):
        if times is not None:
            limits = [*(f"{upper * 1e-6:g}" for upper in times.upper_us), "+Inf"]
            buckets = list(zip(limits, accumulate(times.counts), strict=True))
            family = HistogramMetricFamily(f"acqd_{name}", text, labels=list(labels))
            family.add_metric(list(labels.values()), buckets, times.sum_us * 1e-6)
            yield family


def _with(
    metric: CounterMetricFamily | GaugeMetricFamily, labels: dict[str, str], value: float
) -> CounterMetricFamily | GaugeMetricFamily:
    metric.add_metric(list(labels.values()), value)
    return metric


def _counters(snapshot: Snapshot) -> _Figures:
    delivery, cycles, source = snapshot.delivery or Delivery(), snapshot.cycles, snapshot.source
    on_way = snapshot.delivery is not None
    return [
        ("rows", "Rows made (daemon) or stored (sink)", snapshot.rows),
        ("rows_quarantined", "Messages refused by the sink", snapshot.quarantined),
        ("messages_delivered", "Messages acknowledged by the broker", delivery.delivered if on_way else None),
        ("messages_dropped", "Messages given up because spool or queue was full", delivery.dropped if on_way else None),
        ("rows_resent", "Rows published again for want of a receipt", delivery.resent),
        ("samples_lost", "Samples lost by the source", source.lost if source else None),
        ("cycles", "Cycles of MAIN_FAST since its last launch", cycles.cycles if cycles else None),
        ("cycles_late", "Wake-ups later than half a period", cycles.late if cycles else None),
        ("cycles_missed", "Timer expiries without a cycle", cycles.missed if cycles else None),
        ("cycles_exceeded", "Cycles that took longer than a period", cycles.exceeded if cycles else None),
        ("main_fast_restarts", "Launches of MAIN_FAST after the first", cycles.restarts if cycles else None),
    ]


def _gauges(snapshot: Snapshot) -> _Figures:
    judged, delivery = verdict(snapshot), snapshot.delivery or Delivery()
    synchronised = None if snapshot.synchronised is None else float(snapshot.synchronised)
    return [
        ("alive", "1 while the service does its work (/healthz)", judged.alive),
        ("ready", "1 while nothing keeps rows from arriving (/readyz)", judged.ready),
        ("uptime_seconds", "Time since the start", snapshot.uptime_s),
        ("last_row_age_seconds", "Time since the last row", snapshot.last_row_age_s),
        ("messages_waiting", "Messages not delivered yet", delivery.waiting if snapshot.delivery else None),
        ("receipts_outstanding", "Rows published and not known to be stored", delivery.receipts_outstanding),
        ("spool_bytes", "Size of the spool", delivery.spool_bytes),
        ("spool_limit_bytes", "Limit of the spool", delivery.spool_limit_bytes),
        ("spool_age_seconds", "Age of the oldest row that waits", delivery.spool_age_s),
        ("clock_synchronised", "1 while the kernel calls its clock synchronised", synchronised),
    ]
