"""Test signals of IEC 61000-4-15 edition 2 (2010), as in the public test bench of QWTB's algorithm flicker_sim."""

from __future__ import annotations

import numpy as np

_SINUSOIDAL_HZ = [*np.arange(0.5, 8.1, 0.5), 8.8, *np.arange(9.5, 12.1, 0.5), *range(13, 26)]
_LAMP_230 = (
    2.325, 1.397, 1.067, 0.879, 0.747, 0.645, 0.564, 0.497, 0.442, 0.396, 0.357, 0.325, 0.3, 0.280, 0.265,
    0.256, 0.250, 0.254, 0.261, 0.271, 0.283, 0.298, 0.314, 0.351, 0.393, 0.438, 0.486, 0.537, 0.590,
)  # fmt: skip
_LAMP_120 = (
    2.453, 1.465, 1.126, 0.942, 0.815, 0.717, 0.637, 0.570, 0.514, 0.466, 0.426, 0.393, 0.366, 0.346, 0.332,
    0.323, 0.321, 0.329, 0.341, 0.355, 0.373, 0.394, 0.417, 0.469, 0.528, 0.592, 0.660, 0.734, 0.811,
)  # fmt: skip
_HIGH = {
    ("230V", 50): (0.646, 0.704, 0.764, 0.828, 0.894, 0.964, 1.037),
    ("230V", 60): (0.645, 0.703, 0.764, 0.826, 0.892, 0.959, 1.029),
    ("120V", 60): (0.892, 0.977, 1.067, 1.160, 1.257, 1.359, 1.464),
    ("120V", 50): (0.892, 0.978, 1.068, 1.162, 1.261, 1.365, 1.476),
}
SINUSOIDAL = {
    system: dict(zip(_SINUSOIDAL_HZ, (*(_LAMP_230 if system[0] == "230V" else _LAMP_120), *high), strict=True))
    for system, high in _HIGH.items()
}
"""Lamp and mains frequency: Hz of the fluctuation: relative change [%] at which the largest Pinst is 1 (table 1)."""
RECTANGULAR = {
    ("230V", 50): {1: 2.715, 2: 2.191, 7: 1.450, 39: 0.894, 110: 0.722, 1620: 0.407, 4000: 2.343},
    ("120V", 60): {1: 3.181, 2: 2.564, 7: 1.694, 39: 1.040, 110: 0.844, 1620: 0.548, 4800: 4.837},
    ("120V", 50): {1: 3.178, 2: 2.561, 7: 1.694, 39: 1.045, 110: 0.844, 1620: 0.545, 4000: 3.426},
    ("230V", 60): {1: 2.719, 2: 2.194, 7: 1.450, 39: 0.895, 110: 0.723, 1620: 0.409, 4800: 3.263},
}
"""Lamp and mains frequency: changes per minute: relative change [%] at which Pst is 1 (table 5)."""


def sinusoidal(lamp: str, f: float, hertz: float, percent: float, rate: float, seconds: float) -> np.ndarray:
    """V."""
    t = np.arange(round(seconds * rate)) / rate
    return carrier(lamp, f, t) * (1 + percent / 200 * np.sin(2 * np.pi * hertz * t))


def rectangular(lamp: str, f: float, per_minute: float, percent: float, rate: float, seconds: float) -> np.ndarray:
    """V; two changes make a period."""
    t = np.arange(round(seconds * rate)) / rate
    high = np.floor(t * per_minute / 60 + 1e-9) % 2 == 0
    return carrier(lamp, f, t) * (1 + percent / 200 * np.where(high, 1.0, -1.0))


def carrier(lamp: str, f: float, t: np.ndarray) -> np.ndarray:
    """V."""
    return np.asarray(float(lamp[:3]) * np.sqrt(2) * np.sin(2 * np.pi * f * t))
