"""Faults of clocks: set by hand, without a battery, believed by the maintenance."""

from __future__ import annotations

import os
import random
import subprocess
import time

from acqd.errors import OperationError
from tools.studies.faults.bed import Bed
from tools.studies.faults.clock import CACHE_S, FakedClock
from tools.studies.faults.fault import pause
from tools.studies.faults.servers import ACQD

_DAY_S = 86_400.0


def stepped(bed: Bed, chance: random.Random) -> None:
    """The daemon's clock is set, and later set right."""
    _set(bed, chance.choice([-1.0, -5.0, 2.0, 30.0]), chance)


def days_ahead(bed: Bed, chance: random.Random) -> None:
    """The daemon's clock is two days ahead for seconds: rows wait in quarantine for a person."""
    _set(bed, 2 * _DAY_S, chance)


def days_behind(bed: Bed, chance: random.Random) -> None:
    """The daemon starts with a clock 40 days behind and cannot send; then the clock is set, and the broker is there."""
    assert bed.clock is not None
    proxy = bed.proxies["daemon"]
    proxy.mode = "refuse"
    proxy.reset()
    bed.daemon.stop()
    bed.clock.set(-40 * _DAY_S)
    bed.daemon.start()
    pause(chance, 3.0, 6.0)
    bed.clock.set(0.0)
    time.sleep(CACHE_S)
    proxy.mode = "pass"


def sink_behind(bed: Bed, chance: random.Random) -> None:
    """The sink's computer starts with a clock two days behind, as one without a battery."""
    assert bed.sink_clock is not None
    bed.sink.stop()
    bed.sink_clock.set(-2 * _DAY_S)
    bed.sink.start()
    pause(chance, 3.0, 6.0)
    bed.sink_clock.set(0.0)
    time.sleep(CACHE_S)


def maintained(bed: Bed, chance: random.Random) -> None:
    """Somebody's clock is 40 or 400 days ahead when the maintenance runs: it has to refuse."""
    clock = FakedClock(bed.folder / "maintain.clock")
    clock.set(chance.choice([40, 400]) * _DAY_S)
    command = [*ACQD, "sink", "maintain", "--config", str(bed.folder / "sink.toml")]
    done = subprocess.run(command, env=os.environ | clock.environment(), capture_output=True, text=True, check=False)
    if done.returncode == 0:
        raise OperationError(f"maintenance with a clock that is wrong by weeks did not refuse: {done.stdout}")


def _set(bed: Bed, seconds: float, chance: random.Random) -> None:
    assert bed.clock is not None
    bed.clock.set(seconds)
    pause(chance, 2.0, 5.0)
    bed.clock.set(0.0)
    time.sleep(CACHE_S)
