"""A cell whose logs arrive and whose power is in the database."""

import numpy as np
import orjson
from scipy.signal import lfilter

from acqd.models import features
from acqd.models.bundle.bundle import save_bundle
from acqd.models.bundle.envelope import Envelope
from acqd.models.bundle.reference import reference_arrays
from acqd.models.segments import Segment
from acqd.storage.database import open_database
from acqd.storage.received import Received
from acqd.storage.writer import Writer
from acqd.telemetry import topics
from tests.builders import AXES, STEP, grey, grey_bundle

BEGIN = 1_700_000_000.0


CLOCK = 1.3  # s that the robot's clock is ahead


def motion(rows, seed):
    """Rest, smooth motion, rest."""
    chance = np.random.default_rng(seed)
    t = np.arange(rows) * STEP
    q = np.zeros((rows, AXES))
    for _ in range(3):
        rate, phase, size = chance.uniform(0.1, 0.4, AXES), chance.uniform(0, 6, AXES), chance.uniform(0.2, 0.5, AXES)
        q += size * np.sin(2 * np.pi * rate * t[:, None] + phase)
    k = np.arange(rows)
    ease = np.clip(np.minimum(k - 50, rows - 50 - k) / 60, 0, 1)[:, None]
    return q[50] + ease**3 * (10 - 15 * ease + 6 * ease**2) * (q - q[50])


def power_of(q, seed, extra=0.0):
    """What a meter sees."""
    noise = lfilter([0.3], [1, -0.7], np.random.default_rng(seed).normal(0, 1, len(q)))
    return grey().sequence(q, np.ones((len(q), 1))) + noise + extra


def write_log(path, q, begin_s):
    """Generic CSV at 25 Hz, the robot's clock."""
    t = begin_s + CLOCK + STEP * np.arange(len(q))
    tau = grey().motor_torque(*features.motion(q, STEP))[0]
    names = [f"{quantity}{k + 1}" for quantity in ("q", "tau") for k in range(AXES)]
    lines = [",".join(["time", *names, "brake"])]
    rows = np.column_stack([q, tau])
    lines += [f"{stamp:.4f}," + ",".join(f"{v:.6f}" for v in row) + ",1" for stamp, row in zip(t, rows, strict=True)]
    path.write_text("\n".join(lines) + "\n")


def store_power(url, P, begin_s, first=0):
    """Rows as the sink writes them; windows begin half a row before the log's samples."""
    messages = []
    for k, value in enumerate(P):
        ns = round((begin_s + STEP * (k - 0.5)) * 1e9)
        row = {
            "device": "cell", "channel": "L1", "boot": "b", "seq": first + k, "time": rfc3339(ns), "schema": 1,
            "filetime": ns // 100 + 116_444_736_000_000_000, "Vrms": 230.0, "Irms": 1.0, "P": float(value),
            "S": float(value), "PF": 1.0, "f": 50.0, "W": 0.0, "flags": [],
        }  # fmt: skip
        messages.append(Received(topics.power("cell", "L1"), orjson.dumps(row)))
    written = Writer(open_database(url)).write(messages)
    assert written.rows == len(P), written


def rfc3339(ns):
    from acqd.telemetry.row import rfc3339 as text

    return text(ns)


def cell(folder, url, count, extra=0.0, rows=800, first=0):
    """`count` logs in `folder`, their power in the database."""
    for number in range(first, first + count):
        begin, q = BEGIN + 60.0 * number, motion(rows, number)
        padded = np.concatenate([np.repeat(q[:1], 100, axis=0), q, np.repeat(q[-1:], 100, axis=0)])
        store_power(url, power_of(padded, number, extra), begin - 100 * STEP, 10_000 * number)
        write_log(folder / f"log_{number:03d}.csv", q, begin)


def write_bundle(path):
    """A bundle that remembers recordings to compare with."""
    segments = []
    for number in range(900, 912):
        q = motion(1000, number)
        P, begin, name = power_of(q, number), BEGIN - 1e6 + number * 60, f"r{number}"
        segments.append(Segment(name, name, "r", "test", q, P, None, {"brake": np.ones(1000)}, begin))
    envelope = Envelope.of(segments, STEP).as_json()
    save_bundle(path, grey_bundle(reference_arrays(segments), envelope=envelope))
