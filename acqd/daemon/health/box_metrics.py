"""Metrics of every source of a daemon, with the label `box`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric

from acqd.daemon.health.snapshot import BoxHealth, Snapshot, SourceLink, Windows

_Figure = tuple[str, str, Callable[[BoxHealth], float | None]]


def _cycles(name: str) -> Callable[[BoxHealth], float | None]:
    return lambda box: None if box.cycles is None else float(getattr(box.cycles, name))


_COUNTERS: tuple[_Figure, ...] = (
    ("box_windows", "Windows metered", lambda box: box.windows.made),
    ("box_samples_lost", "Samples lost by the source", lambda box: box.source.lost),
    ("box_restarts", "Times the source was started again after a failure", lambda box: box.restarts),
    ("box_main_fast_restarts", "Launches of MAIN_FAST after the first", _cycles("restarts")),
    ("box_cycles_missed", "Timer expiries without a cycle", _cycles("missed")),
    ("box_cycles_exceeded", "Cycles longer than a period", _cycles("exceeded")),
)  # fmt: skip
_GAUGES: tuple[_Figure, ...] = (
    ("box_connected", "1 while the source is connected", lambda box: float(box.source.connected)),
    ("box_last_row_age_seconds", "Time since the last row", lambda box: box.last_row_age_s),
)


def sources_of(snapshot: Snapshot) -> Sequence[BoxHealth]:
    """Every source of a daemon; a single one has the name of the daemon."""
    if snapshot.boxes:
        return snapshot.boxes
    source, windows = snapshot.source or SourceLink(True), snapshot.windows or Windows()
    age, cycles = snapshot.last_row_age_s, snapshot.cycles
    return [BoxHealth(snapshot.name, (snapshot.name,), "", source, last_row_age_s=age, windows=windows, cycles=cycles)]


def box_metrics(boxes: Sequence[BoxHealth], labels: dict[str, str]) -> Iterator[Metric]:
    """One family per figure; what a source does not have is left out."""
    names = [*labels, "box"]
    for name, text, value in _COUNTERS:
        yield _filled(CounterMetricFamily(f"acqd_{name}", text, labels=names), boxes, labels, value)
    for name, text, value in _GAUGES:
        yield _filled(GaugeMetricFamily(f"acqd_{name}", text, labels=names), boxes, labels, value)
    flagged = CounterMetricFamily("acqd_box_windows_flagged", "Windows with this flag", labels=[*names, "flag"])
    for box in boxes:
        for flag, count in sorted(box.windows.flags.items()):
            flagged.add_metric([*labels.values(), box.name, flag], count)
    yield flagged


def _filled(
    family: CounterMetricFamily | GaugeMetricFamily,
    boxes: Sequence[BoxHealth],
    labels: dict[str, str],
    value: Callable[[BoxHealth], float | None],
) -> Metric:
    for box in boxes:
        number = value(box)
        if number is not None:
            family.add_metric([*labels.values(), box.name], number)
    return family
