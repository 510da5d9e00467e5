"""The folder of a fleet's results: one run at a time, report.json and report.html complete or not at all."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import orjson

from acqd.atomic import write_complete
from acqd.errors import UserError
from acqd.fleet.page import page_of
from acqd.fleet.prior import priors_of
from acqd.fleet.settings import Fleet
from acqd.fleet.summary import FleetReport
from acqd.report.chain import REPORT, continued_in

_MARK = "fleet.lock"


@contextmanager
def claimed(out: Path) -> Iterator[None]:
    """Keep other runs out of the folder. Raises UserError when one is at work, or the folder holds something else."""
    if out.exists() and not (out / _MARK).exists() and (not out.is_dir() or any(out.iterdir())):
        raise UserError(f"{out} exists and holds no fleet's results; choose another --out")
    try:
        out.mkdir(parents=True, exist_ok=True)
        with (out / _MARK).open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield
    except BlockingIOError:
        raise UserError(f"{out}: another run of this fleet is at work; wait for it") from None
    except PermissionError as error:
        raise UserError(f"{out}: cannot be written ({error.strerror}); choose another --out") from None


def write_report(out: Path, fleet: Fleet, report: FleetReport) -> None:
    """Write report.json, report.html and a prior for every type. Raises OperationError."""
    text = orjson.dumps(report.as_json(), option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY)
    write_complete(out / REPORT, page_of(fleet, report, out).html().encode())
    for row in report.robots:
        for page in [row["report"], row["dataset"] and str(Path(row["dataset"]) / REPORT)]:
            if page:
                continued_in(Path(page), out / REPORT)
    write_complete(out / "report.json", text)
    for name, prior in priors_of(fleet).items():
        prior.write(out / "priors" / f"{name}.json")
