"""Commands of the double: one JSON object a line in, one JSON object out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.doubles.sampled_values.faults import KINDS
from tests.doubles.sampled_values.stream import SvStream
from tests.doubles.sampled_values.unit import Lane, MergingUnit

Fields = dict[str, Any]


def answer(unit: MergingUnit, fields: Fields) -> Fields:
    """Carries out one command and returns the answer, {"error": ...} for a wrong one.

    `stream` (0, 1, ...) in the command selects one stream; without it a command concerns all.
    """
    try:
        name = next(key for key in fields if key in _UNIT or key in _LANE)
        if name in _UNIT:
            return {"ok": True, **_UNIT[name](unit, fields[name])}
        lanes = [unit.lanes[fields["stream"]]] if "stream" in fields else unit.lanes
        for lane in lanes:
            _LANE[name](lane, fields[name], fields)
        return {"ok": True}
    except StopIteration:
        return {"error": f"no command in {fields}"}
    except (ValueError, TypeError, KeyError, IndexError) as error:
        return {"error": f"{type(error).__name__}: {error}"}


def _start(unit: MergingUnit, value: Any) -> Fields:
    unit.start()
    return {}


def _stop(unit: MergingUnit, value: Any) -> Fields:
    unit.stop()
    return {}


def _stall(unit: MergingUnit, value: Any) -> Fields:
    unit.stall(float(value))
    return {}


def _burst(unit: MergingUnit, value: Any) -> Fields:
    return {"sent": unit.burst(int(value))}


def _stats(unit: MergingUnit, value: Any) -> Fields:
    streams = [lane.stats() for lane in unit.lanes]
    return {"running": unit.running, "late_max_s": unit.late_max_s, "streams": streams}


def _quit(unit: MergingUnit, value: Any) -> Fields:
    return {"quit": True}


def _count(fault: str) -> Callable[[Lane, Any, Fields], None]:
    """Setter of a counter of `Faults`."""

    def set_count(lane: Lane, value: Any, fields: Fields) -> None:
        setattr(lane.faults, fault, int(value))

    return set_count


def _malformed(lane: Lane, value: Any, fields: Fields) -> None:
    kind = str(fields.get("kind", "cut"))
    if kind not in KINDS:
        raise ValueError(f"{kind!r} is none of {sorted(KINDS)}")
    lane.faults.kind, lane.faults.malformed = kind, int(value)


def _pause(lane: Lane, value: Any, fields: Fields) -> None:
    """Time of the stream, not of the wall clock, so that a burst pauses by the same frames."""
    if lane.due_s is not None:
        lane.faults.paused_until_s = lane.due_s + float(value)


def _stream(lane: Lane) -> SvStream:
    if not isinstance(lane.source, SvStream):
        raise ValueError("A replayed stream has no state to change")
    return lane.source


def _restart(lane: Lane, value: Any, fields: Fields) -> None:
    stream = _stream(lane)
    stream.restarted_at, stream.first_count = lane.next * stream.asdus, 0


def _synch(lane: Lane, value: Any, fields: Fields) -> None:
    _stream(lane).smp_synch = int(value)


def _conf_rev(lane: Lane, value: Any, fields: Fields) -> None:
    _stream(lane).conf_rev = int(value)


def _simulate(lane: Lane, value: Any, fields: Fields) -> None:
    _stream(lane).simulate = bool(value)


def _test(lane: Lane, value: Any, fields: Fields) -> None:
    _stream(lane).set_test(bool(value))


def _quality(lane: Lane, value: Any, fields: Fields) -> None:
    _stream(lane).set_quality(int(value), fields.get("channel"))


_UNIT: dict[str, Callable[[MergingUnit, Any], Fields]] = {
    "start": _start,
    "stop": _stop,
    "stall_s": _stall,
    "burst": _burst,
    "stats": _stats,
    "quit": _quit,
}
_LANE: dict[str, Callable[[Lane, Any, Fields], None]] = {
    "drop": _count("drop"),
    "duplicate": _count("duplicate"),
    "reorder": _count("reorder"),
    "malformed": _malformed,
    "pause_s": _pause,
    "restart": _restart,
    "synch": _synch,
    "confrev": _conf_rev,
    "simulate": _simulate,
    "test": _test,
    "quality": _quality,
}
