"""A recorded stream: the export of an ABB merging unit at a 400 kV bay, 4000 samples/s, 6.4 s.

Origin: KaeroDot/EPMDigitalITsw @2cbe526 (MIT), `shared/data/waveforms/merging_unit_3ph/source`. It is the packet
list of Wireshark as CSV: time of capture, MAC addresses, frame length and the eight values of each frame. It holds
no raw frames: svID, APPID, smpCnt, confRev, smpSynch and quality were not exported. The frames had 120 octets
(destination 01-0C-CD-04-00-00, one ASDU), which leaves 8 characters for svID, or 4 and a VLAN tag.
"""

from __future__ import annotations

import csv
import gzip
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.doubles.sampled_values.wave import I_A_PER_DIGIT, U_V_PER_DIGIT, repeated

EXPORT = Path("data/waveforms/merging_unit_3ph/source/E_wireshark_export.csv.gz")
"""Path of the export in the folder `shared`."""
_CYCLE = 80
"""Samples of one cycle of 50 Hz at 4000 samples/s."""


class RecordedWave:
    """The recorded values as a wave: whole cycles, repeated without end.

    In and Un are the measured values, not sums. The mains was at 49.9991 to 50.0000 Hz, so the
    last cycle joins the first with a small phase jump.
    """

    neutral_derived = False
    rate = 4000.0
    phases = 3
    scale: tuple[float, ...] = (U_V_PER_DIGIT, I_A_PER_DIGIT) * 3

    def __init__(self, path: Path) -> None:
        """Reads the export. Raises OSError where it is absent, ValueError where it holds no samples."""
        times, values = _read(path)
        count = len(values) // _CYCLE * _CYCLE
        if count == 0:
            raise ValueError(f"{path} holds no whole cycle of sampled values")
        self.times_s = times[:count]
        """Time of capture [s] of each sample, in steps of the recorder's buffer (about 0.6 ms)."""
        self._wire = values[:count]
        self._table = np.ascontiguousarray(self._wire[:, [4, 0, 5, 1, 6, 2]])

    def __len__(self) -> int:
        """Samples before the wave repeats."""
        return len(self._wire)

    def codes(self, first: int, count: int) -> NDArray[np.int32]:
        """int32 [count, 6]: U1, I1, U2, I2, U3, I3 of the samples `first`, `first` + 1, ..."""
        return repeated(self._table, first, count)

    def channels(self, first: int, count: int) -> NDArray[np.int32]:
        """int32 [count, 8] in the order of `wave.CHANNELS`."""
        return repeated(self._wire, first, count)


def _read(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    with gzip.open(path, "rt", encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["value"]]
    times = np.array([float(row["Time"]) for row in rows])
    values = np.array([row["value"].split(",") for row in rows], dtype=np.int32).reshape(-1, 8)
    return times, values
