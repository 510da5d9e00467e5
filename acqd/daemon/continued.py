"""Energy registers after a power cut: continued from what others know of the last rows (ADR 32).

The sink's last row has W, import minus export, of the very last window; the retained summary has both registers, of up
to a second before. A rise of W beyond the known registers is imported energy, a fall exported energy.
"""

from __future__ import annotations

from acqd.telemetry.last_rows import Known
from acqd.telemetry.spool import Energy

FLAG = "W_unconfirmed"
"""Of the first rows after a power cut, where no sink has said which rows it has, and of those of a register that could
not be read: W may have gone back."""


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
