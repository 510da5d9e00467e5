"""The health of `acqd sink`: its loop, its broker and its database."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from acqd import __version__
from acqd.daemon.health.section import HealthSection
from acqd.daemon.health.service import ServiceHealth
from acqd.daemon.health.snapshot import Link, Snapshot
from acqd.telemetry import certificates

if TYPE_CHECKING:
    from acqd.storage.sink import Sink
    from acqd.storage.upkeep import Upkeep

_TURN_S = 120.0  # without a turn of its loop: longer than any lock or statement may take


class SinkHealth(ServiceHealth):
    """Of a sink whose loop has to turn: rows need not come."""

    def __init__(
        self,
        section: HealthSection,
        sink: Sink,
        name: str,
        upkeep: Upkeep | None = None,
        own_certificates: Sequence[Path | None] = (),
    ) -> None:
        self._sink, self._name, self._upkeep = sink, name, upkeep
        super().__init__(section.host, section.sink_port, None, own_certificates)

    def alive(self) -> bool:
        """Whether the loop turns: broker and database may be away, and rows may not come."""
        return self.standstill_s < _TURN_S

    def snapshot(self) -> Snapshot:
        """The sink now."""
        sink = self._sink
        counters = sink.counters
        last = counters.last_commit
        trouble = counters.database_trouble
        return Snapshot(
            service="sink",
            name=self._name,
            version=__version__,
            uptime_s=self.uptime_s,
            alive=self.alive(),
            rows=counters.rows,
            last_row_age_s=None if last is None else time.monotonic() - last,
            quarantined=counters.quarantined,
            impossible=counters.impossible,
            lag_s=counters.lag_s,
            clock_trouble=counters.clock_trouble,
            boots_trouble=counters.boots_trouble,
            refused_trouble=counters.refused_trouble,
            upkeep_trouble=self._upkeep.trouble if self._upkeep is not None else "",
            disk_days=self._upkeep.disk_days if self._upkeep is not None else None,
            recalls=counters.recalls,
            acknowledged=self.acknowledged,
            certificate_trouble=self.certificate_trouble,
            broker=Link(
                sink.connected,
                max(counters.reconnects, 0),
                counters.broker_trouble,
                certificate_trouble=certificates.near_end("of the broker", counters.certificate),
            ),
            database=Link(not trouble, counters.database_returns, trouble),
        )
