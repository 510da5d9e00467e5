"""Regressors of an invented robot, and the power that they cause behind any supply."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import STEP_S, Regressors, behind_supply

_COLUMNS = 6
WINDOW_S = 0.04


def robot(count, seed, seconds=40.0):
    """`count` recordings, 20 s apart, on a controller's clock that starts at 0."""
    random = np.random.default_rng(seed)
    made = []
    for number in range(count):
        noise = random.normal(size=(round(seconds / STEP_S), _COLUMNS))
        smooth = gaussian_filter1d(noise, 7, axis=0)  # changes within 0.1 s
        columns = smooth / smooth.std(axis=0)
        made.append(Regressors(number * (seconds + 20.0), columns, columns.sum(axis=1), _COLUMNS))
    return made


def power_of(recordings, lags_s, supply_lag_s, seed, noise_W=1.0, delay_s=0.0):
    """The rows of a meter of 40 ms; unmodelled power of `noise_W` is correlated over 0.15 s."""
    random = np.random.default_rng(seed)
    weights = random.normal(0, 5, _COLUMNS)
    grid = np.arange(-10.0, recordings[-1].t[-1] + 10.0, STEP_S)
    demand = np.full(len(grid), 150.0)
    for single, lag_s in zip(recordings, lags_s, strict=True):
        power = single.columns @ weights
        inside = (grid >= single.t[0] - lag_s) & (grid <= single.t[-1] - lag_s)
        demand[inside] += np.interp(grid[inside] + lag_s, single.t, power)
    late = np.interp(grid - delay_s, grid, behind_supply(demand[:, None], supply_lag_s)[:, 0])
    rough = gaussian_filter1d(random.normal(size=len(grid)), 0.15 / STEP_S / 2)
    late = late + noise_W * rough / rough.std()
    steps = round(WINDOW_S / STEP_S)
    integral = np.concatenate([[0.0], np.cumsum((late[1:] + late[:-1]) / 2)])
    means = np.diff(integral[::steps]) / steps
    time_ns = np.rint(grid[0] * 1e9 + 1e9 * WINDOW_S * np.arange(len(means))).astype(np.int64)
    return PowerStream(time_ns, means, np.full(len(means), 230.0), round(1e9 * WINDOW_S), 0, "simulated", "test")
