"""Every row of the tape against the database, field by field."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Set
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise, takewhile
from pathlib import Path
from typing import Any

import orjson
import sqlalchemy as sa

from acqd.storage import quarantined, sink_flags
from acqd.storage.clock_witness import IMPOSSIBLE
from acqd.storage.schema import power, quarantine
from acqd.storage.waiting import rows_in_spools
from acqd.telemetry.spool import Stream

_FIELDS = ("filetime", "Vrms", "Irms", "P", "S", "PF", "f", "W", "schema")
_Key = tuple[str, str, str, int]  # device, channel, boot, seq
_SECOND = 10_000_000
"""Of `filetime`."""


@dataclass(frozen=True, slots=True)
class Reconciled:
    """What became of the rows."""

    made: int
    stored: int
    lost: int
    """Taped, neither in the database nor in a spool, and not `unspooled`."""
    duplicated: int
    """A moment of a channel that is stored more than once."""
    wrong: int
    """Stored with another value than taped, or never taped."""
    unflagged: int
    """Windows missing between two rows of a boot without the flag `gap`."""
    backwards: int
    """Rows of a boot and channel whose time or energy is less than that of the row before."""
    energy_back: int
    """Boots whose energy begins below the last stored row of the boot before."""
    quarantined: int
    waiting: int = 0
    """Taped, not in the database, and in the spool of the daemon: a slow computer has not delivered them yet."""
    contested: int = 0
    """Rows of the daemon that are in quarantine, because a forged row with their key was stored before."""
    unspooled: int = 0
    """The last rows of a start of the daemon, less than a second of them, that are on the tape alone: a kill between
    the two writes. They were on no disk but the tape's, which no service has."""
    cut_short: int = 0
    """Starts of the daemon that ended so; each needs a kill."""


def reconcile(
    tapes: Iterable[Path],
    engine: sa.Engine,
    forged: Path | None = None,
    beside: str = "",
    state_dir: Path | None = None,
) -> Reconciled:
    """Compare tapes, the daemon's first, with the tables `power` and `quarantine`.

    `forged`: rows by others with keys of the daemon. Where one of these was stored first, the daemon's row has to be in
    quarantine. `beside`: a device that is not looked at. `state_dir`: of the daemon, which has ended.
    """
    tapes = list(tapes)
    made = _taped(tapes)
    with engine.connect() as connection:
        query = sa.select(power).where(power.c.device != beside)
        stored = {_key(row): row for row in connection.execute(query).mappings()}
        refused = {bytes(payload) for payload in connection.execute(sa.select(quarantine.c.payload)).scalars()}
    taken = {_key(row) for row in _rows(forged)} if forged is not None else set()
    behind = {key for key in taken & made.keys() & stored.keys() if _differs(made[key], stored[key])}
    kept = {key for key in map(_key, _readable(refused)) if key in behind}
    moments = Counter((key[0], key[1], row["filetime"]) for key, row in stored.items() if key not in taken)
    wrong = sum(key not in made or _differs(made[key], row) for key, row in stored.items() if key not in taken)
    spooled = rows_in_spools(state_dir) if state_dir is not None else {}
    missing_keys = made.keys() - stored.keys()
    waiting = {key for key in missing_keys if key[3] in spooled.get(Stream(*key[:3]), ())}
    nowhere = missing_keys - waiting
    ends = list(_unspooled_ends(_taped(tapes[:1]), nowhere))
    unspooled = sum(map(len, ends))
    return Reconciled(
        made=len(made),
        stored=len(stored),
        lost=len(nowhere) - unspooled + len(behind - kept),
        waiting=len(waiting),
        duplicated=sum(count - 1 for count in moments.values()),
        wrong=wrong,
        contested=len(kept),
        unspooled=unspooled,
        cut_short=len(ends),
        quarantined=len(refused),
        **_order(made, stored.keys()),
    )


def _unspooled_ends(taped: dict[_Key, Any], nowhere: Set[_Key]) -> Iterator[list[_Key]]:
    """For each start of the daemon, its last rows as far as they are nowhere; only where that is less than a second.

    The daemon writes all rows that it has metered at a time to the tape, and then to the spool.
    """
    starts: dict[tuple[str, str], list[_Key]] = defaultdict(list)
    for device, channel, boot, seq in taped:
        starts[device, boot.partition(".")[0]].append((device, channel, boot, seq))
    for rows in starts.values():
        end = list(takewhile(nowhere.__contains__, reversed(rows)))
        if end and taped[end[0]]["filetime"] - taped[end[-1]]["filetime"] < _SECOND:
            yield end


def missing(tapes: Iterable[Path], engine: sa.Engine) -> int:
    """Rows of the tapes that the database does not have yet."""
    columns = (power.c.device, power.c.channel, power.c.boot, power.c.seq)
    with engine.connect() as connection:
        stored = {tuple(row) for row in connection.execute(sa.select(*columns))}
    return len(_taped(tapes).keys() - stored)


def restore(tapes: Iterable[Path], engine: sa.Engine) -> None:
    """As a person would: rows of the tapes that wait in quarantine because of their times go where they belong."""
    made = _taped(tapes)
    waiting = quarantined.entries(engine, quarantined.Which(reason=IMPOSSIBLE))
    ids = [entry.id for entry in waiting if any(_key(row) in made for row in _readable([entry.payload]))]
    if ids:
        quarantined.restore(engine, quarantined.Which(ids))


def _taped(tapes: Iterable[Path]) -> dict[_Key, Any]:
    return {_key(row): row for tape in tapes for row in _rows(tape)}


def _rows(tape: Path) -> Iterator[Any]:
    """Rows of a file; its last line may be torn."""
    return map(orjson.loads, tape.read_bytes().split(b"\n")[:-1])


def _readable(payloads: Iterable[bytes]) -> Iterator[Any]:
    """Those of the refused messages that are rows."""
    for payload in payloads:
        with suppress(ValueError, TypeError, KeyError):
            row = orjson.loads(payload)
            _key(row)
            yield row


def _key(row: Any) -> _Key:
    return row["device"], row["channel"], row["boot"], row["seq"]


def _differs(taped: Any, stored: Any) -> bool:
    flags = stored["flags"]
    flags = orjson.loads(flags) if isinstance(flags, str) else flags
    same_time = _moment(taped["time"]) == _moment(stored["time"])
    same_flags = [name for name in flags if name not in sink_flags.FLAGS] == taped["flags"]
    return not same_flags or not same_time or any(taped[name] != stored[name] for name in _FIELDS)


def _moment(time: Any) -> datetime:
    return time if isinstance(time, datetime) else datetime.fromisoformat(time)


def _order(made: dict[_Key, Any], stored: Set[_Key]) -> dict[str, int]:
    """Order and flags within and between boots, from the tape.

    A killed daemon may have taped a window that reached no disk: its energy is metered by nobody else.
    """
    boots: dict[tuple[str, str], dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
    for row in made.values():
        boots[row["device"], row["channel"]][row["boot"]].append(row)
    found = Counter[str]()
    for runs in boots.values():
        for rows in runs.values():
            for before, row in pairwise(rows):
                jump = row["seq"] > before["seq"] + 1
                found["unflagged"] += jump and "gap" not in row["flags"] and "gap" not in before["flags"]
                found["backwards"] += row["filetime"] <= before["filetime"] or row["seq"] <= before["seq"]
        for rows, following in pairwise(runs.values()):
            last = next((row for row in reversed(rows) if _key(row) in stored), None)
            found["energy_back"] += last is not None and following[0]["W"] < last["W"]
    return {name: found[name] for name in ("unflagged", "backwards", "energy_back")}
