"""Power cuts on a real file system: ext4 on a loop device that is shut down without its journal, and mounted again.

    python -m tools.studies.faults.power_cut [--sqlite 10] [--postgres 5] [--daemon 10] [--seed 1] [--json]

`sqlite`, `postgres`: the sink's computer loses power; its database is on that file system. `daemon`: the daemon's
computer does, with its state_dir; then the register file gets the id of another start of the computer.
Rows that were taped more than a second before a cut must be in the database at the end, once, and W never goes back.
Needs root, a loop device, mosquitto and PostgreSQL. Simulated source. Exit 1 when something is not so.
"""

from __future__ import annotations

import json as json_
import random
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import groupby, pairwise
from pathlib import Path
from typing import Annotated, Any

import orjson
import sqlalchemy as sa
import typer
from rich.table import Table

from acqd.cli.main import for_people
from acqd.errors import UserError
from acqd.storage.database import engine_for, open_database
from acqd.storage.schema import power
from acqd.telemetry.ports import free_port
from acqd.timestamps import unix_s
from tools.common.ending import end_in_order
from tools.common.tables import show
from tools.studies.faults import disk
from tools.studies.faults.process import Process
from tools.studies.faults.servers import ACQD, broker, postgres

_AT_RISK_S = 1.0
_PATIENCE_S = 240.0
"""A busy computer may take a minute to start a process again."""


@dataclass(slots=True)
class Cuts:
    """What became of the rows of one kind of cut."""

    kind: str
    cuts: int = 0
    made: int = 0
    lost: int = 0
    """Taped, not in the database."""
    lost_older: int = 0
    """Of these, taped more than a second before the next cut."""
    duplicated: int = 0
    energy_back: int = 0
    """Rows in the database whose W is below that of the row before."""
    unconfirmed: int = 0
    """Rows flagged W_unconfirmed."""

    @property
    def good(self) -> bool:
        """Whether nothing that must not happen has happened."""
        return not (self.lost_older or self.duplicated or self.energy_back)


def power_cut(
    sqlite: Annotated[int, typer.Option(min=0, help="Cuts of the sink's computer, with SQLite.")] = 10,
    postgresql: Annotated[int, typer.Option("--postgres", min=0, help="The same with PostgreSQL.")] = 5,
    daemon: Annotated[int, typer.Option(min=0, help="Cuts of the daemon's computer.")] = 10,
    seed: Annotated[int, typer.Option(help="Moments of the cuts.")] = 1,
    json: Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")] = False,
) -> None:
    """Cut the power again and again, and count what became of the rows.

    Example: python -m tools.studies.faults.power_cut --sqlite 3 --postgres 0 --daemon 3
    """
    end_in_order()
    if reason := disk.missing():
        raise UserError(f"power cuts: {reason}")
    disk.own_mounts()
    done = []
    for kind, cuts in (("sqlite", sqlite), ("postgres", postgresql), ("daemon", daemon)):
        if cuts:
            with tempfile.TemporaryDirectory(prefix="acqd-cuts-") as folder:
                done.append(_Chain(Path(folder), kind).run(cuts, random.Random(f"{seed} {kind}")))
    if json:
        print(json_.dumps([asdict(each) | {"good": each.good} for each in done]))
    else:
        table = Table(*asdict(done[0]), title="power cuts (simulated source)")
        for each in done:
            table.add_row(*map(str, asdict(each).values()))
        show(table, width=120)
    raise SystemExit(0 if all(each.good for each in done) else 1)


class _Chain:
    """Daemon, broker and sink; one of the two ends is on the file system that is cut."""

    def __init__(self, folder: Path, kind: str) -> None:
        self._folder, self._kind = folder, kind
        self._place = folder / "disk"
        self._disk = disk.SmallDisk(self._place, 400 if kind == "postgres" else 120)
        self._tape, port = folder / "tape", free_port()
        state = self._place if kind == "daemon" else folder
        self._register = state / "energy-cell1.json"
        self._server: Process | None = None
        url = str((folder if kind == "daemon" else self._place) / "a.sqlite")
        if kind == "postgres":
            self._server, url = postgres(folder, self._place)
            self._server.start()
        open_database(url).dispose()
        self._url, self._engine = url, engine_for(url, impatient=True)
        config = folder / "acqd.toml"
        config.write_text(
            f'device = "cell1"\nstate_dir = "{state}"\n[mqtt]\nport = {port}\n[source]\npower = 2000.0\n'
            f'[sink]\ndatabase = "{url}"\n[health]\nport = 0\nsink_port = 0\n[realtime]\npriority = 0\n'
        )
        self._broker = broker("mosquitto", folder, port)
        run = [*ACQD, "run", "--config", str(config), "--tape", str(self._tape)]
        self._daemon = Process(run, folder / "daemon.log")
        self._sink = Process([*ACQD, "sink", "--config", str(config)], folder / "sink.log")

    def run(self, cuts: int, draw: random.Random) -> Cuts:
        """Cut so many times; then wait until all has arrived that will."""
        found, moments = Cuts(self._kind), list[tuple[float, float]]()
        for process in (self._broker, self._sink, self._daemon):
            process.start()
        try:
            for _ in range(cuts):
                self._wait(self._stored_since(time.time()), "a row is stored")
                time.sleep(draw.uniform(1.0, 4.0))
                begun = time.time()
                self._disk.cut()
                moments.append((begun, self._restart()))
                found.cuts += 1
            self._wait(self._stored_since(time.time()), "a row is stored")
            self._daemon.stop()
            with suppress(UserError):
                self._wait(lambda: not self._lost(), "every row is stored", 10.0)
            self._count(found, moments)
        finally:
            self._engine.dispose()
            for process in (self._daemon, self._sink, self._broker, *([self._server] if self._server else [])):
                process.kill()
            self._disk.unmount()
        return found

    def _restart(self) -> float:
        """When the processes were gone: on a busy computer, rows are made for a while after the cut of the disk."""
        cut = [self._daemon] if self._kind == "daemon" else [self._sink, *([self._server] if self._server else [])]
        for process in cut:
            process.lose_power()
        gone = time.time()
        self._engine.dispose()
        self._disk.mount_again()
        if self._kind == "daemon":
            register = orjson.loads(self._register.read_bytes())
            register["run"]["start"] = "11" * 16
            self._register.write_bytes(orjson.dumps(register))
        for process in reversed(cut):
            process.start()
        return gone

    def _wait(self, condition: Callable[[], object], what: str, seconds: float = _PATIENCE_S) -> None:
        deadline = time.monotonic() + seconds
        while True:
            with suppress(sa.exc.DBAPIError):
                if condition():
                    return
            if time.monotonic() > deadline:
                raise UserError(f"power cuts: not within {seconds:g} s: {what}; see {self._folder}")
            time.sleep(0.1)

    def _stored_since(self, begin: float) -> Callable[[], bool]:
        def stored() -> bool:
            with self._engine.connect() as connection:
                query = sa.select(power.c.filetime).order_by(power.c.filetime.desc()).limit(1)
                newest = connection.execute(query).scalar()
            return newest is not None and unix_s(newest) > begin

        return stored

    def _taped(self) -> dict[tuple[str, str, int], Any]:
        rows = [orjson.loads(line) for line in self._tape.read_bytes().split(b"\n")[:-1] if line.startswith(b"{")]
        return {(row["channel"], row["boot"], row["seq"]): row for row in rows}

    def _stored(self) -> list[Any]:
        """Of a server without limits of time: on a busy computer, all rows take long to be read."""
        columns = (power.c.channel, power.c.boot, power.c.seq, power.c.filetime, power.c.W, power.c.flags)
        engine = engine_for(self._url)
        with engine.connect() as connection:
            stored = list(connection.execute(sa.select(*columns).order_by(power.c.channel, power.c.filetime)))
        engine.dispose()
        return stored

    def _lost(self) -> list[Any]:
        known = {(row.channel, row.boot, row.seq) for row in self._stored()}
        return [row for key, row in self._taped().items() if key not in known]

    def _count(self, found: Cuts, moments: list[tuple[float, float]]) -> None:
        stored, lost = self._stored(), self._lost()
        found.made, found.lost = len(self._taped()), len(lost)
        times = [unix_s(row["filetime"]) for row in lost]
        found.lost_older = sum(not any(cut - _AT_RISK_S - 0.1 <= at <= gone for cut, gone in moments) for at in times)
        found.unconfirmed = sum("W_unconfirmed" in row.flags for row in stored)
        for _, rows in groupby(stored, key=lambda row: row.channel):
            for before, row in pairwise(rows):
                found.duplicated += row.filetime == before.filetime
                found.energy_back += row.W < before.W - 1e-12


if __name__ == "__main__":
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(power_cut)
    for_people(app)
