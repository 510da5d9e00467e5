"""Logs of a UR3e that measure their own power: nothing to align, so that a build takes a moment."""

import numpy as np

from acqd.dataset.build import BuildConfig, build
from tests.campaigns import quiet

STEP_S = 0.02
AXES = 6


def motion(seconds, seed=0, start_s=100.0):
    """time [T], q [T, 6] of an arm that moves and rests in turn, and the power [T] of its motion."""
    random = np.random.default_rng(seed)
    time = start_s + STEP_S * np.arange(int(seconds / STEP_S))
    elapsed = time - start_s
    moving = (elapsed % 6.0) < 4.0  # 4 s of motion, 2 s of rest
    phase = 2 * np.pi * (elapsed % 6.0) / 4.0
    sweep = np.where(moving, 1 - np.cos(phase), 0.0)
    q = sweep[:, None] * random.uniform(0.1, 0.4, AXES)
    qd = np.gradient(q, STEP_S, axis=0)
    return time, q, 60 + 20 * np.abs(qd).sum(axis=1) + random.normal(0, 0.5, len(time))


def write_log(path, time, q, power=None, **columns):
    """A CSV with the generic header."""
    values = {"time": time} | {f"q{k + 1}": q[:, k] for k in range(AXES)}
    values |= {} if power is None else {"power": power}
    values |= columns
    rows = [",".join(f"{x:.9g}" for x in row) for row in zip(*values.values(), strict=True)]
    path.parent.mkdir(exist_ok=True, parents=True)
    path.write_text("\n".join([",".join(values), *rows, ""]))
    return path


def write_logs(folder, count, seconds=12, first=1):
    """Logs rec_0001.csv and so on, each at a time of its own."""
    for number in range(first, first + count):
        write_log(folder / f"rec_{number:04d}.csv", *motion(seconds, number, 1000.0 * number))
    return folder


def build_from(logs, out, **options):
    """A dataset of logs that measure their own power."""
    return build(BuildConfig("log", logs, out, options.pop("robot", "ur3e"), **options), quiet)
