"""A double as a process: one line {"ready": true, ...}, commands on standard input, its end ends the process.

python -m tests.doubles.modbus bridge [--port 5020] [--phases 3] [--clock lockstep --advance 20]
python -m tests.doubles.modbus meters --model sdm630 --units 1-20 --rtu [--baudrate 9600]
python -m tests.doubles.modbus meters --model b23 --units 1,5 --port 5021
"""

from __future__ import annotations

import argparse
import json
import sys

from tests.doubles.modbus.bridge import WaveformBridge
from tests.doubles.modbus.commands import obey
from tests.doubles.modbus.layouts import LAYOUTS
from tests.doubles.modbus.meter import RmsMeter
from tests.doubles.modbus.rtu import ModbusRtuDouble
from tests.doubles.modbus.tcp import ModbusTcpDouble
from tests.doubles.waveform import WaveTable

_A_PER_UNIT = 0.1
"""Meters on one line differ in current by this much [A], so that a mix-up of units shows."""


def _units(text: str) -> list[int]:
    units: list[int] = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        units.extend(range(int(first), int(last or first) + 1))
    return units


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.doubles.modbus", description=__doc__.splitlines()[0])
    kinds = parser.add_subparsers(dest="kind", required=True)
    bridge = kinds.add_parser("bridge")
    bridge.add_argument("--phases", type=int, choices=(1, 2, 3), default=3)
    bridge.add_argument("--rate", type=float, default=20_000.0)
    bridge.add_argument("--frames", type=int)
    bridge.add_argument("--slots", type=int)
    bridge.add_argument("--clock", choices=("real", "lockstep"), default="real")
    bridge.add_argument("--advance", type=int, default=20)
    bridge.add_argument("--drift-ppm", type=float, default=0.0)
    bridge.add_argument("--no-utc", action="store_true")
    bridge.add_argument("--unit", type=int, default=1)
    meters = kinds.add_parser("meters")
    meters.add_argument("--model", choices=tuple(LAYOUTS), required=True)
    meters.add_argument("--units", type=_units, default=[1])
    meters.add_argument("--vrms", type=float, default=230.0)
    meters.add_argument("--irms", type=float, default=2.0)
    meters.add_argument("--swing", type=float, default=0.005)
    meters.add_argument("--swap-words", action="store_true")
    meters.add_argument("--rtu", action="store_true")
    meters.add_argument("--baudrate", type=int)
    for each in (bridge, meters):
        each.add_argument("--host", default="127.0.0.1")
        each.add_argument("--port", type=int, default=0)
    return parser.parse_args()


def _bridge(arguments: argparse.Namespace) -> WaveformBridge:
    return WaveformBridge(
        WaveTable(arguments.rate, arguments.phases),
        frames=arguments.frames,
        slots=arguments.slots,
        clock=arguments.clock,
        advance=arguments.advance,
        drift_ppm=arguments.drift_ppm,
        utc=not arguments.no_utc,
    )


def _meter(arguments: argparse.Namespace, unit: int) -> RmsMeter:
    return RmsMeter(
        arguments.model,
        Vrms=arguments.vrms,
        Irms=arguments.irms + _A_PER_UNIT * (unit - min(arguments.units)),
        swing=arguments.swing,
        swap_words=arguments.swap_words,
    )


def _serve_tcp(double: ModbusTcpDouble) -> None:
    with double:
        print(json.dumps({"ready": True, "port": double.port}), flush=True)
        obey(double, sys.stdin, sys.stdout)


def _serve_rtu(double: ModbusRtuDouble) -> None:
    with double:
        print(json.dumps({"ready": True, "path": double.path}), flush=True)
        obey(double, sys.stdin, sys.stdout)


def main() -> None:
    """Serve until standard input ends."""
    arguments = _arguments()
    if arguments.kind == "bridge":
        _serve_tcp(ModbusTcpDouble({arguments.unit: _bridge(arguments)}, arguments.host, arguments.port))
        return
    units = {unit: _meter(arguments, unit) for unit in arguments.units}
    if arguments.rtu:
        _serve_rtu(ModbusRtuDouble(units, arguments.baudrate))
    else:
        _serve_tcp(ModbusTcpDouble(units, arguments.host, arguments.port))


if __name__ == "__main__":
    main()
