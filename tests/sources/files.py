"""Waveform files."""

from __future__ import annotations

import numpy as np

from tests.mains import make_mains


def write_csv(path, rows=4_000, rate=10_000.0, t0=0.0, header="time,u1,i1", delimiter=","):
    mains = make_mains(50.0, seconds=rows / rate, rate=rate, phases=1)
    t = t0 + np.arange(rows) / rate
    table = np.column_stack((t, mains.codes * np.array(mains.scale)))
    lines = [delimiter.join(f"{value:.9f}" for value in row) for row in table]
    path.write_text("\n".join([header.replace(",", delimiter), *lines]) + "\n")
    return mains
