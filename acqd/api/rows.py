"""Power rows from files and databases."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, cast

import numpy as np

from acqd.api.doubts import warn_of
from acqd.api.html import table
from acqd.api.places import Place
from acqd.arrays import Floats
from acqd.extras import require
from acqd.timestamps import Nanoseconds

if TYPE_CHECKING:
    import pandas
    import pyarrow


@dataclass(frozen=True, slots=True)
class Rows:
    """Power rows of one channel of one device, at rising times, without duplicates."""

    time_ns: Nanoseconds
    """[N] UTC of each window's first sample, ns since 1970."""
    P: Floats
    """[N] W; NaN where the flags of a row make it unusable."""
    Vrms: Floats
    """[N] V; NaN where unknown."""
    window_s: float
    """Length of a window, s."""
    measured: str
    """Origin of the power: mains, bus, derived or simulated."""

    def __len__(self) -> int:
        return len(self.P)

    def _repr_html_(self) -> str:
        """For notebooks: span, length and power."""
        span = [f"{datetime.fromtimestamp(int(t) / 1e9, UTC):%Y-%m-%d %H:%M:%S}" for t in self.time_ns[[0, -1]]]
        P = self.P[np.isfinite(self.P)]
        watts = [f"{value:.1f}" for value in (P.min(), P.mean(), P.max())] if len(P) else ["-"] * 3
        origin = "simulated" if self.measured == "simulated" else f"power: {self.measured}"
        head = ("from (UTC)", "to (UTC)", "row [s]", "lowest P [W]", "mean P [W]", "highest P [W]")
        return table(f"{len(self)} rows, {origin}", head, [(*span, f"{self.window_s:g}", *watts)])

    def to_arrow(self) -> pyarrow.Table:
        """A table with `time` (UTC timestamps), `P` and `Vrms`, and the units in the metadata of the fields."""
        require("Rows.to_arrow", ("pyarrow",), "parquet")
        from acqd.dataset.arrow import recording_table

        return recording_table(self.time_ns, {"P": self.P, "Vrms": self.Vrms})

    def to_pandas(self) -> pandas.DataFrame:
        """The same as a data frame with `time` as its index. Raises UserError without pandas."""
        require("to_pandas", ("pandas",), "pandas")
        return cast("pandas.DataFrame", self.to_arrow().to_pandas().set_index("time"))


def read_rows(source: Place, *, device: str | None = None, channel: str | None = None) -> Rows:
    """Rows of a .csv, .jsonl or .parquet file, a .sqlite file or an SQL URL.

    `device` and `channel` default to the only device, and to total, else L1. Parquet needs pyarrow (`acqd[parquet]`),
    everything else nothing more than acqd. Warns of doubtful times and values. Raises InputError, UserError.

    >>> rows = read_rows("power.csv")
    >>> rows.measured, rows.window_s
    ('simulated', 0.04)
    """
    from acqd.dataset.power import open_power

    stream = open_power(str(source), device, channel)
    warn_of(stream.notes)
    return Rows(stream.time_ns, stream.P, stream.Vrms, stream.window_ns * 1e-9, stream.measured)
