"""Rows that were made again against rows that are stored: the same numbers, or which ones are not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acqd.errors import InputError, UserError
from acqd.telemetry.row import PowerRow, parse_row
from acqd.timestamps import filetime, rfc3339, utc_ns

FIELDS = ("filetime", "Vrms", "Irms", "P", "S", "PF", "f", "W", "flags")
_OF_THE_SINK = {"sink_clock"}
"""Flags that a sink adds."""
_SHOWN = 5

_Key = tuple[str, str, int]


@dataclass(slots=True)
class Comparison:
    """Counts of rows."""

    stored: dict[_Key, PowerRow] = field(repr=False)
    """By channel, boot and number; those that were compared are taken out."""
    same: int = 0
    """To the last bit."""
    different: int = 0
    not_stored: int = 0
    """Rows of the archive that nobody has stored."""
    examples: list[str] = field(default_factory=list)
    """The first rows that differ."""

    @staticmethod
    def of(rows: Iterable[PowerRow]) -> Comparison:
        """With these rows."""
        return Comparison({(row.channel, row.boot, row.seq): row for row in rows})

    def take(self, rows: Iterable[PowerRow]) -> None:
        """Rows that were made again."""
        for row in rows:
            stored = self.stored.pop((row.channel, row.boot, row.seq), None)
            if stored is None:
                self.not_stored += 1
            elif (wrong := [name for name in FIELDS if _value(row, name) != _value(stored, name)]) == []:
                self.same += 1
            else:
                self.different += 1
                if len(self.examples) < _SHOWN:
                    told = ", ".join(f"{n} {_value(stored, n)!r}, again {_value(row, n)!r}" for n in wrong)
                    self.examples.append(f"{row.time} {row.channel}: {told}")

    @property
    def not_archived(self) -> int:
        """Stored rows whose samples are not in the archive."""
        return len(self.stored)


def _value(row: PowerRow, name: str) -> Any:
    value = getattr(row, name)
    return sorted(set(value) - _OF_THE_SINK) if name == "flags" else value


def stored_rows(place: str, device: str, begin_ns: int, end_ns: int) -> Iterator[PowerRow]:
    """Rows of a device from a file of JSON lines, a .sqlite file or an SQL URL. Raises UserError."""
    if place.endswith((".jsonl", ".json")):
        yield from _of_lines(Path(place), device, begin_ns, end_ns)
    else:
        yield from _of_database(place, device, begin_ns, end_ns)


def _of_lines(path: Path, device: str, begin_ns: int, end_ns: int) -> Iterator[PowerRow]:
    first, after = filetime(begin_ns), filetime(end_ns)
    try:
        with path.open("rb") as file:
            for number, line in enumerate(file, start=1):
                try:
                    row = parse_row(line)
                except ValueError as error:
                    raise InputError(path, f"line {number} is no row: {error}") from None
                if row.device == device and first <= row.filetime < after:
                    yield row
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None


def _of_database(url: str, device: str, begin_ns: int, end_ns: int) -> Iterator[PowerRow]:
    import sqlalchemy as sa  # slow to import

    from acqd.storage.database import read_database
    from acqd.storage.schema import power

    names = [name for name in PowerRow.__struct_fields__ if name != "time"]
    chosen = sa.select(*(power.c[name] for name in names)).where(
        power.c.device == device, power.c.filetime >= filetime(begin_ns), power.c.filetime < filetime(end_ns)
    )
    engine = read_database(url)
    try:
        with engine.connect() as connection:
            for row in connection.execution_options(yield_per=10_000).execute(chosen).mappings():
                yield PowerRow(**row, time=rfc3339(utc_ns(row["filetime"])))
    except sa.exc.SQLAlchemyError as error:
        raise UserError(f"{url}: {str(error).splitlines()[0]}") from None
    finally:
        engine.dispose()
