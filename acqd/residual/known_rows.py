"""Rows of a segment whose motion is known: at the ends of a log it is not, inside of a cut log it is."""

from __future__ import annotations

from acqd.models.effects.substeps import RADIUS
from acqd.models.segments import Segment


def known_rows(segment: Segment) -> slice:
    """Rows with known motion around them; the power of the first ones may belong to motion before the log."""
    before, after = (0 if each is None else len(each) for each in (segment.before, segment.after))
    first = 1 if before >= RADIUS else RADIUS + 1
    return slice(first, len(segment.P) - (0 if after >= RADIUS else RADIUS))
