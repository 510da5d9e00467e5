"""Control of the false discovery rate over the robots of a fleet.

Benjamini and Hochberg (1995): with p-values p(1) <= ... <= p(m), the robots up to the largest k with
p(k) <= k q / m are called changed. The expected share of unchanged ones among them is at most q, if the p-values of
unchanged robots are independent, or positively dependent (Benjamini and Yekutieli 2001, theorem 1.2). Under any
dependence, q is divided by 1 + 1/2 + ... + 1/m (theorem 1.3).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from acqd.arrays import Floats

Method = Literal["benjamini-hochberg", "benjamini-yekutieli"]


def adjusted(p: Floats, method: Method = "benjamini-hochberg") -> Floats:
    """Adjusted p-values [m]: the smallest rate q at which each robot is called changed."""
    count = len(p)
    if not count:
        return np.zeros(0)
    order = np.argsort(p, kind="stable")
    factor = harmonic(count) if method == "benjamini-yekutieli" else 1.0
    raw = factor * count * np.asarray(p, dtype=float)[order] / np.arange(1, count + 1)
    values = np.minimum(np.minimum.accumulate(raw[::-1])[::-1], 1.0)
    back = np.empty(count)
    back[order] = values
    return back


def harmonic(count: int) -> float:
    """1 + 1/2 + ... + 1/count."""
    return float((1.0 / np.arange(1, count + 1)).sum())
