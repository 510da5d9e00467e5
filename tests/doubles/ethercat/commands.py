"""Commands of a test: one JSON object a line, each changes the segment or asks for its counters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from .clock import RealClock
from .segment import Segment
from .terminal import PowerTerminal

Command = dict[str, Any]


def apply(segment: Segment, command: Command) -> Command:
    """Answer to a command: {"ok": true}, the counters, or {"error": text}."""
    for name, action in ACTIONS.items():
        if name in command:
            try:
                return action(segment, command) or {"ok": True}
            except (ValueError, TypeError, IndexError, KeyError) as error:
                return {"error": f"{name}: {error}"}
    return {"error": f"unknown command {sorted(command)}; known are {sorted(ACTIONS)}"}


def _terminal(segment: Segment, command: Command, key: str = "terminal") -> PowerTerminal:
    number = int(command.get(key, 0))
    if not 0 <= number < len(segment.terminals):
        raise ValueError(f"there is no terminal {number}")
    return segment.terminals[number]


def _drop_frames(segment: Segment, command: Command) -> None:
    segment.drops = int(command["drop_frames"])


def _drop_blocks(segment: Segment, command: Command) -> None:
    segment.skip(int(command["drop_blocks"]))


def _repeat(segment: Segment, command: Command) -> None:
    segment.repeats = int(command["repeat"])


def _overrange(segment: Segment, command: Command) -> None:
    _terminal(segment, command).faults.overrange = command["overrange"]


def _sync_error(segment: Segment, command: Command) -> None:
    _terminal(segment, command).faults.sync_error = bool(command["sync_error"])


def _invalid(segment: Segment, command: Command) -> None:
    _terminal(segment, command).faults.invalid = bool(command["invalid"])


def _range(segment: Segment, command: Command) -> None:
    channel, wanted = int(command["channel"]), command["range"]
    if channel not in (0, 1, 2) or wanted not in ("1A", "5A"):
        raise ValueError("range is 1A or 5A, channel is 0, 1 or 2 (I1, I2, I3)")
    _terminal(segment, command).faults.ranges[channel] = wanted == "1A"


def _al_error(segment: Segment, command: Command) -> None:
    _terminal(segment, command).states.fail(int(command["al_error"]))


def _lose_slave(segment: Segment, command: Command) -> None:
    _terminal(segment, command, "lose_slave")
    segment.link(int(command["lose_slave"]))


def _restore_slave(segment: Segment, command: Command) -> None:
    _terminal(segment, command, "restore_slave")
    segment.link(len(segment.terminals))


def _cable(segment: Segment, command: Command) -> None:
    segment.connected = {"in": True, "out": False}[command["cable"]]


def _power_cycle(segment: Segment, command: Command) -> None:
    _terminal(segment, command, "power_cycle").power_cycle()


def _drift(segment: Segment, command: Command) -> None:
    if not isinstance(segment.clock, RealClock):
        raise ValueError("the virtual clock of lockstep has no rate")
    segment.clock.set_drift(float(command["dc_drift_ppm"]))


def _stats(segment: Segment, command: Command) -> Command:
    terminals = [_counters(terminal) for terminal in segment.terminals]
    return {"frames": segment.frames, **terminals[0], "terminals": terminals}


def _counters(terminal: PowerTerminal) -> Command:
    known = terminal.last is not None and terminal.clock.start is not None
    sample = terminal.first_sample(terminal.last or 0) if known else None
    return {
        "blocks_sent": terminal.sent,
        "first_block": terminal.first,
        "last_block": terminal.last,
        "last_block_first_sample": sample,
        "state": terminal.states.state,
    }


ACTIONS: Final[dict[str, Callable[[Segment, Command], Command | None]]] = {
    "al_error": _al_error,
    "cable": _cable,
    "dc_drift_ppm": _drift,
    "drop_blocks": _drop_blocks,
    "drop_frames": _drop_frames,
    "invalid": _invalid,
    "lose_slave": _lose_slave,
    "overrange": _overrange,
    "power_cycle": _power_cycle,
    "range": _range,
    "repeat": _repeat,
    "restore_slave": _restore_slave,
    "stats": _stats,
    "sync_error": _sync_error,
}
