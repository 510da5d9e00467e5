"""From a demand and measured figures to computers.

Everything is taken as proportional to rows/s, and the boxes of a daemon as a straight line through one and eight
boxes. Robots are divided into cells of one broker, its sinks and one database; a cell is filled before the next one
starts, so that more robots never need less.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from acqd.errors import UserError
from acqd.planning.demand import Demand
from acqd.planning.measured import Measured, Quantity

KEEP_DAYS = 30.0
"""Default of `[sink] keep_days`."""
KEEP_ROLLUPS_DAYS = 365.0
"""Default of `[sink] keep_1min_days`; rows of power quality of 10 min and 2 h are kept for as long."""
SPOOL_GB = 1.0
"""Default of `[spool] max_mb`."""
_DAY_S, _NIGHT_S = 86_400.0, 4 * 3_600.0
_BOXES_MEASURED = 8
_INTERVALS_S = {"10/12": 0.2, "150/180": 3.0, "10min": 600.0}
"""Length of an aggregation interval (IEC 61000-4-30:2015, section 4.5); the longer ones always have rows."""
_TEN_SECONDS, _TWO_HOURS = 10.0, 7_200.0


@dataclass(frozen=True, slots=True)
class Need:
    """One line of a plan."""

    part: str
    name: str
    value: float
    unit: str
    why: str
    """The assumption, or how the value follows."""
    keys: tuple[str, ...] = ()
    """Of the measured quantities behind the value."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What a demand needs."""

    demand: Demand
    needs: tuple[Need, ...]
    used: tuple[Quantity, ...]
    """The measured quantities behind the plan."""

    def value(self, part: str, name: str) -> float:
        """The value of a line. Raises KeyError."""
        return {(one.part, one.name): one.value for one in self.needs}[part, name]


def plan(demand: Demand, measured: Measured) -> Plan:
    """The plan. Raises UserError where one robot is too much for a core or a disk."""
    needs = tuple(_Arithmetic(demand, {key: one.value for key, one in measured.items()}).needs())
    keys = {key for one in needs for key in one.keys}
    return Plan(demand, needs, tuple(one for key, one in measured.items() if key in keys))


_LOAD = ("rows_stored",)
_QUALITY = ("quality_message", "row_packet")
_WHOLE, _SLOW = ("one_box_cpu", "eight_boxes_cpu"), ("one_box_slow", "eight_boxes_slow")


class _Arithmetic:
    """A plan in the making: rates of one robot, then robots of a cell, then all."""

    def __init__(self, demand: Demand, m: dict[str, float]) -> None:
        self._demand, self._m = demand, m
        self.rate = demand.channels * demand.rows_per_second
        short = long = 0.0
        if demand.quality != "off":
            wanted = _INTERVALS_S[demand.quality]
            intervals = [seconds for seconds in (*_INTERVALS_S.values(), _TWO_HOURS) if seconds >= wanted]
            short = demand.channels * sum(1 / s for s in intervals if s < 600.0) + 1 / _TEN_SECONDS
            long = demand.channels * sum(1 / s for s in intervals if s >= 600.0)
        self.short, self.long = short, long
        """Rows of power quality a second of one robot: of intervals below 10 min, and of the others."""
        self.quality = short + long
        self._quality_keys = _QUALITY if self.quality else ()

    def needs(self) -> Iterator[Need]:
        """All lines."""
        carried = self._carried()
        at_most = min(carried, self._demand.boxes)
        yield from self._measuring(carried, at_most)
        yield from self._cells(at_most)

    def _extra(self) -> dict[str, float]:
        """CPU of what a box does besides its rows [% of a core], by key."""
        asked = {"quality_cpu": self._demand.quality != "off", "archive_cpu": self._demand.archive_days > 0}
        return {key: self._m[key] for key, wanted in asked.items() if wanted}

    def _carried(self) -> int:
        """Boxes that the cores of a PC carry. Raises UserError for none."""
        demand, extra = self._demand, sum(self._extra().values())
        # MAIN_SLOW of all boxes is one process: one core, however many the PC has.
        carried = min(
            self._boxes(*_WHOLE, extra, 100 * demand.load * demand.cores),
            self._boxes(*_SLOW, extra, 100 * demand.load),
        )
        if carried < 1:
            raise UserError(f"a box takes more than --load {demand.load:g} of a core: raise --load, or leave parts out")
        return carried

    def _measuring(self, carried: int, most: int) -> Iterator[Need]:
        demand, m, extra = self._demand, self._m, self._extra()
        boxes = min(most, demand.robots)
        pcs = math.ceil(demand.robots / boxes)
        part = "measurement PCs"
        keys = (*_WHOLE, *_SLOW, *extra)
        why = f"--boxes {demand.boxes}" if most == demand.boxes else f"--load {demand.load:g} of {_cores(demand.cores)}"
        if most > _BOXES_MEASURED:
            why += f"; over {_BOXES_MEASURED} not measured"
        yield Need(part, "PCs", pcs, "", f"{boxes} boxes at a PC, one box for a robot", keys)
        yield Need(part, "boxes at a PC at most", most, "", why, keys)
        why = f"{demand.load:g} of a core for MAIN_SLOW, {_cores(demand.cores)} in all"
        yield Need(part, "boxes that the cores would carry", carried, "", why, keys)
        cpu = self._line(*_WHOLE, boxes) + sum(extra.values()) * boxes
        yield Need(part, "CPU of a PC", cpu, "%", "of a core; MAIN_FAST at 10 ms, a message a window", keys)
        memory = ("one_box_memory", "eight_boxes_memory")
        yield Need(part, "memory of the daemon", self._line(*memory, boxes), "MB", "without the system's own", memory)
        archived = m["archive_day"] * demand.archive_days * boxes
        why = f"spool {SPOOL_GB:g} GB" + (f", archive of {demand.archive_days:g} days" if archived else "; no archive")
        yield Need(part, "disk of a PC", SPOOL_GB + archived, "GB", why, ("archive_day",) if archived else ())
        hours = 1e9 * SPOOL_GB / (boxes * self._spooled()) / 3_600
        why = "then the oldest rows go; [spool] max_mb, when_full"
        yield Need(part, "broker or database may be away for", hours, "h", why, ("spooled_row", *self._quality_keys))

    def _cells(self, boxes: int) -> Iterator[Need]:
        demand, m = self._demand, self._m
        in_rows = self.rate + self.quality * m["quality_message"] / m["row_packet"]
        broker = self._robots_of("broker", "broker_cpu", in_rows)
        sink = self._robots_of("sink", "sink_cpu", in_rows)
        # the nightly run rolls up a day, and for late rows the one before
        row_us = self.rate * (2 * m["rollup_time"] + m["deletion_time"]) + self.quality * m["deletion_time"]
        busy_s = _DAY_S * row_us / 1e6
        night = int(_NIGHT_S // busy_s)
        if night < 1:
            raise UserError(f"the nightly run takes {busy_s / 3_600:.3g} h for one robot: fewer --rows-per-second")
        limits = {"the broker's core": broker, "4 h for acqd sink maintain": night}
        if demand.disk_gb is not None and demand.days is not None:
            disk = int(demand.disk_gb // self._gigabytes(demand.days))
            if disk < 1:
                needed = self._gigabytes(demand.days)
                raise UserError(
                    f"--disk {demand.disk_gb:g}: rows of one robot need {needed:.3g} GB for --days {demand.days:g} "
                    "with a year of roll-ups: fewer days, or more disk"
                )
            limits["--disk"] = disk
        limit = min(limits, key=lambda name: limits[name])
        most = limits[limit]
        robots = min(demand.robots, most)
        cells, rest = math.ceil(demand.robots / most), demand.robots % most
        sinks = demand.robots // most * math.ceil(most / sink) + math.ceil(rest / sink)
        quality = self._quality_keys
        night_keys = ("rollup_time", "deletion_time")
        part = "brokers, sinks and databases"
        yield Need(
            part,
            "brokers",
            cells,
            "",
            "mosquitto, one for each cell, one core each",
            (*_LOAD, "broker_cpu", *night_keys, *quality),
        )
        yield Need(part, "databases", cells, "", "PostgreSQL, one for each cell", night_keys)
        yield Need(
            part, "sinks", sinks, "", f"{sink} robots each at --load {demand.load:g}", (*_LOAD, "sink_cpu", *quality)
        )
        yield Need(
            part,
            "robots of a cell at most",
            most,
            "",
            f"limited by {limit}",
            (*_LOAD, "broker_cpu", *night_keys, *quality),
        )
        yield from self._one_cell("largest cell", robots, in_rows, math.ceil(robots / sink), boxes)
        yield from self._kept("largest cell", robots)
        part = "all together"
        rows = demand.robots * (self.rate + self.quality)
        why = f"{demand.channels} channels of {demand.rows_per_second:g} rows/s"
        if self.quality:
            why += f", power quality {self.quality:.3g} rows/s"
        yield Need(part, "rows", rows, "rows/s", why)
        yield Need(
            part,
            "network into the brokers",
            self._megabits(demand.robots),
            "Mbit/s",
            "messages, without TCP and IP",
            _QUALITY if quality else ("row_packet",),
        )
        yield Need(part, "tables", demand.robots * self._raw(), "GB/day", "rows as they come", self._table_keys())
        behind = demand.load / (1 - demand.load)
        yield Need(part, "an hour of outage is caught up after", behind, "h", "sinks busy to --load while all is well")

    def _one_cell(self, part: str, robots: int, in_rows: float, sinks: int, boxes: int) -> Iterator[Need]:
        demand, m = self._demand, self._m
        quality = self._quality_keys
        packets = _QUALITY if quality else ("row_packet",)
        quality_too = "; a message of power quality by its bytes" if quality else ""
        yield Need(part, "robots", robots, "", "the first cells are full")
        # One daemon has one connection for all of its boxes; with fewer boxes at a PC there are more.
        why = f"a PC a robot, and sinks; {math.ceil(robots / boxes) + sinks} with {boxes} boxes at a PC"
        yield Need(part, "connections of the broker", robots + sinks, "", why)
        yield Need(
            part, "rows into the broker", robots * (self.rate + self.quality), "rows/s", "and as many to the sinks"
        )
        yield Need(
            part, "bytes into the broker", robots * self._bytes() / 1e6, "MB/s", "and as many to the sinks", packets
        )
        yield Need(
            part,
            "network at the broker",
            2 * self._megabits(robots),
            "Mbit/s",
            "in and out, without TCP and IP",
            packets,
        )
        yield Need(
            part,
            "CPU of the broker",
            m["broker_cpu"] / m["rows_stored"] * in_rows * robots,
            "%",
            "of a core" + quality_too,
            (*_LOAD, "broker_cpu", *quality),
        )
        used = m["database_cpu"] / m["rows_stored"] * in_rows * robots
        yield Need(
            part,
            "cores of the database",
            math.ceil(used / 100 / demand.load),
            "",
            f"{used:.3g} % of a core at --load {demand.load:g}",
            (*_LOAD, "database_cpu", *quality),
        )
        logged = robots * (self.rate * m["row_log"] + self.quality * m["quality_table"] * m["row_log"] / m["row_table"])
        yield Need(
            part,
            "written to the database's log",
            logged / 1e6,
            "MB/s",
            "beside the tables",
            ("row_log", *(("quality_table", "row_table") if quality else ())),
        )

    def _kept(self, part: str, robots: int) -> Iterator[Need]:
        demand = self._demand
        keys = self._table_keys()
        rolled_keys = ("minute_table", "quarter_table", *(("quality_table",) if self.quality else ()))
        yield Need(part, "tables, rows", robots * self._raw(), "GB/day", "[sink] keep_days deletes them", keys)
        why = "1 min, 15 min" + ("; power quality of 10 min, 2 h" if self.quality else "")
        yield Need(part, "tables, rolled up", robots * self._rolled(), "GB/day", why, rolled_keys)
        days = demand.days
        if days is None and demand.disk_gb is not None:
            days = (demand.disk_gb / robots - KEEP_ROLLUPS_DAYS * self._rolled()) / self._raw()
            if days <= 0:
                needed = KEEP_ROLLUPS_DAYS * self._rolled() * robots
                raise UserError(
                    f"--disk {demand.disk_gb:g}: a year of roll-ups of {robots} robots needs {needed:.3g} GB"
                )
            yield Need(
                part,
                "retention that fits",
                days,
                "days",
                f"--disk {demand.disk_gb:g} GB, a year of roll-ups",
                (*keys, *rolled_keys),
            )
        days = KEEP_DAYS if days is None else days
        yield Need(
            part,
            "disk of the database",
            robots * self._gigabytes(days),
            "GB",
            f"rows of {days:.4g} days, roll-ups of a year",
            (*keys, *rolled_keys),
        )

    def _table_keys(self) -> tuple[str, ...]:
        return ("row_table", *(("quality_table",) if self.quality else ()))

    def _robots_of(self, what: str, share: str, in_rows: float) -> int:
        """How many robots keep a core busy to the load that is allowed."""
        rows = 100 * self._demand.load / self._m[share] * self._m["rows_stored"]
        if rows < in_rows:
            raise UserError(f"one robot sends as much as {in_rows:.4g} rows/s, a {what} takes {rows:.4g}: raise --load")
        return int(rows // in_rows)

    def _line(self, one: str, eight: str, boxes: int) -> float:
        """The value for so many boxes, on a line through one and eight."""
        first, last = self._m[one], self._m[eight]
        return first + (boxes - 1) * max(last - first, 0.0) / (_BOXES_MEASURED - 1)

    def _boxes(self, one: str, eight: str, extra: float, most: float) -> int:
        """How many boxes take no more than `most`."""
        first = self._line(one, eight, 1) + extra
        another = self._line(one, eight, 2) + extra - self._line(one, eight, 1)
        if first > most:
            return 0
        return 1 + (int((most - first) // another) if another > 0 else self._demand.robots)

    def _spooled(self) -> float:
        """Bytes that one robot writes to the spool, a second."""
        row = self._m["spooled_row"]
        return self.rate * row + self.quality * row * self._m["quality_message"] / self._m["row_packet"]

    def _bytes(self) -> float:
        """Bytes of the messages of one robot, a second."""
        return self.rate * self._m["row_packet"] + self.quality * self._m["quality_message"]

    def _megabits(self, robots: int) -> float:
        return robots * self._bytes() * 8 / 1e6

    def _raw(self) -> float:
        """GB of rows that one robot adds to the database in a day, and that are deleted after some days."""
        return _DAY_S / 1e9 * (self.rate * self._m["row_table"] + self.short * self._m["quality_table"])

    def _rolled(self) -> float:
        """GB that one robot adds to what is kept for longer, a day."""
        rolled = self._m["minute_table"] / 60 + self._m["quarter_table"] / 900
        return _DAY_S / 1e9 * (self._demand.channels * rolled + self.long * self._m["quality_table"])

    def _gigabytes(self, days: float) -> float:
        """GB of one robot: rows of so many days, roll-ups of a year."""
        return days * self._raw() + KEEP_ROLLUPS_DAYS * self._rolled()


def _cores(count: int) -> str:
    return "1 core" if count == 1 else f"{count} cores"
