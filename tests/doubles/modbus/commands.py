"""Commands to a double in another process: {"do": NAME, ...arguments} -> {"ok": true, "result": ...}."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import Any, TextIO

from tests.doubles.modbus.base import ModbusDouble
from tests.doubles.modbus.bridge import WaveformBridge
from tests.doubles.modbus.meter import RmsMeter
from tests.doubles.modbus.tcp import ModbusTcpDouble

Handler = Callable[..., object]


def _of_double(double: ModbusDouble) -> dict[str, Handler]:
    return {
        "latency": double.set_latency,
        "exception": double.set_exception,
        "silent": double.set_silent,
        "stale": double.set_stale,
        "damage": double.damage_next,
        "requests": lambda: {str(unit): count for unit, count in double.requests.items()},
    }


def _of_bridge(bridge: WaveformBridge) -> dict[str, Handler]:
    return {"skip": bridge.skip, "restart": bridge.restart, "mark": bridge.mark}


def _of_meters(meters: dict[int, RmsMeter]) -> dict[str, Handler]:
    def set_points(unit: int | None = None, **points: float) -> None:
        for meter in meters.values() if unit is None else [meters[unit]]:
            for name, value in points.items():
                if name not in ("Vrms", "Irms", "lag", "f"):
                    raise ValueError(f"{name!r} is no set point")
                setattr(meter, name, value)

    return {"values": lambda unit: meters[unit].values, "set": set_points}


def handlers(double: ModbusDouble) -> dict[str, Handler]:
    """The commands that this double and its banks have."""
    found = _of_double(double)
    refuse = getattr(double, "refuse", None)
    if refuse is not None:
        found["refuse"] = refuse
    if isinstance(double, ModbusTcpDouble):
        found["reset"] = double.reset_connections
    bridges = [bank for bank in double.units.values() if isinstance(bank, WaveformBridge)]
    if bridges:
        found.update(_of_bridge(bridges[0]))
    meters = {unit: bank for unit, bank in double.units.items() if isinstance(bank, RmsMeter)}
    return found | _of_meters(meters) if meters else found


def _execute(known: dict[str, Handler], line: str) -> dict[str, Any]:
    try:
        arguments = json.loads(line)
        return {"ok": True, "result": known[arguments.pop("do")](**arguments)}
    except (ValueError, TypeError, KeyError, AttributeError, OSError) as error:
        return {"ok": False, "error": f"{type(error).__name__}: {error}"}


def obey(double: ModbusDouble, lines: Iterable[str], out: TextIO) -> None:
    """Execute each line and answer it, until the input ends."""
    known = handlers(double)
    for line in lines:
        if line.strip():
            out.write(json.dumps(_execute(known, line)) + "\n")
            out.flush()
