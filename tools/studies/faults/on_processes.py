"""Faults of processes: killed, frozen, stalled, or two of one name."""

from __future__ import annotations

import os
import random
import signal
import time
from contextlib import suppress

from tools.studies.faults.bed import DEVICE, Bed
from tools.studies.faults.fault import RESTART_S, Fault, Pick, pause
from tools.studies.faults.process import Process
from tools.studies.faults.servers import ACQD

FAST = b"acqd.plc.process"
_STALL_S = 0.1


def kill(pick: Pick) -> Fault:
    """SIGKILL."""

    def fault(bed: Bed, chance: random.Random) -> None:
        process = pick(bed)
        assert process is not None
        process.kill()
        pause(chance, *RESTART_S)
        process.start()

    return fault


def restart(pick: Pick) -> Fault:
    """SIGTERM, as for an update."""

    def fault(bed: Bed, chance: random.Random) -> None:
        process = pick(bed)
        assert process is not None
        process.stop()
        pause(chance, *RESTART_S)
        process.start()

    return fault


def freeze(pick: Pick) -> Fault:
    """SIGSTOP for seconds."""

    def fault(bed: Bed, chance: random.Random) -> None:
        process = pick(bed)
        assert process is not None
        process.send(signal.SIGSTOP)
        pause(chance, 0.1, 4.0)
        process.send(signal.SIGCONT)

    return fault


def fast(number: signal.Signals, times: int = 1) -> Fault:
    """Signals to MAIN_FAST; nobody takes a SIGSTOP back, the daemon has to notice."""

    def fault(bed: Bed, chance: random.Random) -> None:
        for _ in range(times):
            pid = bed.daemon.child(FAST)
            if pid is not None:
                with suppress(ProcessLookupError):
                    os.kill(pid, number)
            pause(chance, 0.1, 0.6)

    return fault


def stalls(pick: Pick) -> Fault:
    """SIGSTOP for 100 ms, again and again."""

    def fault(bed: Bed, chance: random.Random) -> None:
        process = pick(bed)
        assert process is not None
        for _ in range(chance.randint(5, 15)):
            process.send(signal.SIGSTOP)
            time.sleep(_STALL_S)
            process.send(signal.SIGCONT)
            pause(chance, 0.05, 0.3)

    return fault


def fast_stalls(bed: Bed, chance: random.Random) -> None:
    """MAIN_FAST does not run for 100 ms, again and again: its ring and its catching up bridge that."""
    for _ in range(chance.randint(5, 15)):
        pid = bed.daemon.child(FAST)
        for number in (signal.SIGSTOP, signal.SIGCONT):
            if pid is not None:
                with suppress(ProcessLookupError):
                    os.kill(pid, number)
            time.sleep(_STALL_S)
        pause(chance, 0.0, 0.2)


def all_killed(bed: Bed, chance: random.Random) -> None:
    """The computer is switched off and on (its disk keeps what was written)."""
    processes = [bed.daemon, bed.sink, bed.broker]
    for process in chance.sample(processes, len(processes)):
        process.kill()
    pause(chance, *RESTART_S)
    for process in (bed.broker, bed.sink, bed.daemon):
        process.start()


def second_daemon(bed: Bed, chance: random.Random) -> None:
    """Another daemon of the same name comes, with another load, and goes: no row of it may come under the name."""
    folder = bed.folder / "second"
    folder.mkdir(exist_ok=True)
    config = folder / "acqd.toml"
    config.write_text(
        f'device = "{DEVICE}"\nstate_dir = "{folder}"\n[realtime]\npriority = 0\n[mqtt]\nport = {bed.port}\n'
        "[source]\npower = 900.0\n[health]\nport = 0\n"
    )
    second = Process([*ACQD, "run", "--config", str(config)], folder / "log")
    second.start()
    pause(chance, 3.0, 6.0)
    second.kill()
