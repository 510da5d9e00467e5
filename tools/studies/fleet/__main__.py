"""Judges `acqd fleet` on virtual robots of one type (simulated by the generator of `studies.foreign`).

    python -m tools.studies.fleet OUT [--robots 200] [--minutes 60] [--jobs 2] [--nodes 2] [--json]
    python -m tools.studies.fleet OUT --robots 20 --minutes 10 --reference 10      # a quick version
    python -m tools.studies.fleet OUT --phase make --jobs 16                       # in parts, with the same options:
    python -m tools.studies.fleet OUT --phase judge --jobs 2                       # make, then judge, then prior
    python -m tools.studies.fleet OUT --phase prior --jobs 2

Every robot has a model from an unchanged session. A week later all are recorded at the same time, some with a hidden
effect from some minute on; most of these have the same cause, which sets in at the same time. What is there is not made
again. Making the files is not part of the time that is printed.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console

from acqd.workers import run_here
from tools.studies.fleet.benefit import benefit
from tools.studies.fleet.cases import Scale, cases
from tools.studies.fleet.judge import judged
from tools.studies.fleet.make import MakeTask, make_robot, secret_of, write_fleet
from tools.studies.fleet.tables import print_result


def options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("out", type=Path, metavar="OUT")
    add("--robots", type=int, default=200)
    add("--minutes", type=float, default=60.0, help="in question, per robot (default 60)")
    add("--reference", type=float, default=20.0, help="minutes for the model of a robot (default 20)")
    add("--hidden", type=int, help="robots with hidden effects (default a tenth, at least 5)")
    add("--shared", type=int, help="robots of the shared cause (default three quarters of these)")
    add("--cause", default="viscous_friction", help="the shared cause, of the generator's effects")
    add("--seed", type=int, default=1)
    add("--new", type=int, default=3, help="new robots on which the prior is judged (default 3, 0: none)")
    add("--prior-minutes", type=float, action="append", help="of own data, the most first (default 60, 10, 4)")
    add("--jobs", type=int, default=2)
    add("--engine", choices=("process", "ray"), default="process")
    add("--ray-address", help="of a Ray cluster (default: start one)")
    add("--nodes", type=int, help="start so many local Ray nodes of one core each (implies --engine ray)")
    add("--again", action="store_true", help="forget the results of the fleet, keep the files")
    add("--json", action="store_true")
    add("--phase", choices=("all", "make", "judge", "prior"), default="all", help="one part only (default all)")
    return parser.parse_args()


def main() -> None:
    """Make what is missing, run acqd fleet, print what it is worth."""
    given = options()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    hidden = given.hidden or max(given.robots // 10, 5)
    shared = given.shared or round(0.75 * hidden)
    scale = Scale(given.robots, given.minutes, given.reference, hidden, shared, given.cause, given.seed)
    out = given.out.resolve()
    made_s = 0.0
    if given.phase in ("all", "make"):
        made_s = _make(out, scale, given.jobs)
    if given.phase == "make":
        print(f"{scale.robots} robots in {made_s:.0f} s: {out}")
        return
    fleet = write_fleet(out, cases(scale))
    result: dict[str, Any] = {"label": "simulated"}
    if given.phase != "prior":
        result |= _judge(out, fleet, scale, given) | {"made_s": made_s}
    if given.phase != "judge" and given.new:
        minutes = tuple(given.prior_minutes or (60.0, 10.0, 4.0))
        result["prior"] = benefit(scale, fleet, out, given.new, minutes, given.jobs)
    (out / ("prior.json" if given.phase == "prior" else "result.json")).write_text(json.dumps(result, indent=2))
    if given.json:
        print(json.dumps(result))
    else:
        print_result(result)


def _judge(out: Path, fleet: Path, scale: Scale, given: argparse.Namespace) -> dict[str, Any]:
    """What a run of acqd fleet found, and its times."""
    secrets = {case.name: secret_of(out, case) for case in cases(scale)}
    if given.again:
        shutil.rmtree(out / "fleet.fleet", ignore_errors=True)
    with _nodes(given.nodes) as address:
        if address is not None:
            given.engine, given.ray_address = "ray", address
        report, seconds = _run(fleet, given)
    return judged(report, secrets) | seconds | {"minutes": scale.minutes, "jobs": given.nodes or given.jobs}


def _make(out: Path, scale: Scale, jobs: int) -> float:
    """Files of all robots; the seconds that it took."""
    console, begun = Console(stderr=True), time.monotonic()
    tasks = [MakeTask(scale, case, out) for case in cases(scale)]
    for done, name in enumerate(run_here(make_robot, tasks, jobs, lambda: None), start=1):
        console.print(f"made {done} of {len(tasks)}: {name}", highlight=False)
    return time.monotonic() - begun


@contextmanager
def _nodes(count: int | None) -> Iterator[str | None]:
    """The address of a Ray cluster with so many nodes on this machine; None where none was asked for."""
    if count is None:
        yield None
        return
    from ray.cluster_utils import Cluster

    cluster = Cluster()
    for _ in range(count):
        cluster.add_node(num_cpus=1)
    try:
        yield str(cluster.address)
    finally:
        cluster.shutdown()


def _run(fleet: Path, given: argparse.Namespace) -> tuple[dict[str, Any], dict[str, float]]:
    """The report of `acqd fleet`, wall and CPU seconds."""
    more = ["--ray-address", given.ray_address] if given.ray_address else []
    command = [sys.executable, "-m", "acqd", "fleet", str(fleet), "--jobs", str(given.jobs), "--engine", given.engine]
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    done = subprocess.run([*command, *more, "--json"], stdout=subprocess.PIPE, text=True, check=False)
    if not done.stdout:
        sys.exit(f"acqd fleet ended with {done.returncode}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(done.stdout), {"wall_s": time.monotonic() - begun, "cpu_s": cpu}


if __name__ == "__main__":
    main()
