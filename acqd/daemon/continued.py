"""Energy registers after a power cut: continued from what others know of the last rows (ADR 32).

The sink's last row has W, import minus export, of the very last window; the retained summary has both registers, of up
to a second before. A rise of W beyond the known registers is imported energy, a fall exported energy.
"""

from __future__ import annotations

from collections.abc import Iterable

from acqd.daemon.register import Run
from acqd.telemetry.last_rows import Known
from acqd.telemetry.receipts import LastRow
from acqd.telemetry.spool import Energy, Readings

FLAG = "W_unconfirmed"
"""Of the first rows after a power cut, where no sink has said which rows it has, and of those of a register that could
not be read: W may have gone back."""


def continued_from(
    own: Energy, run: Run | None, spooled: Readings | None, others: Known | None, unread: Iterable[LastRow]
) -> Energy:
    """Each phase's (imported, exported) [kWh].

    `own` are the greater ones of the register file, which `run` has written, and of the spool; `others`: what a sink
    and the broker know; `unread`: later rows of the spool.
    """
    after = spooled.after if spooled is not None else None
    boot = run.boot if run is not None else after.boot if after is not None else ""
    known = Known(boot.partition(".")[0])
    if others is not None and known.is_of(others.boot):
        known.stored, known.summaries = dict(others.stored), others.summaries
    for row in unread:
        known.add(row)
    seq = run.seq if run is not None else -1
    if after is not None and known.is_of(after.boot):
        seq = max(seq, after.seq)
    return continued(own, seq, known)


def continued(own: Energy, seq: int, known: Known) -> Energy:
    """Each phase's (imported, exported) [kWh].

    `own` are those after window `seq` of the boot of `known`, -1: of an unknown window. Only later rows count.
    """
    readings = []
    for phase, (imported, exported) in enumerate(own, start=1):
        channel, newest = f"L{phase}", seq
        summary, row = known.summaries.get(channel), known.stored.get(channel)
        if summary is not None and summary.seq > newest:
            imported, exported, newest = (
                max(imported, summary.imported), max(exported, summary.exported), summary.seq,
            )  # fmt: skip
        if row is not None and row.seq > newest:
            more = row.W - (imported - exported)
            imported, exported = imported + max(more, 0.0), exported + max(-more, 0.0)
        readings.append((imported, exported))
    return readings
