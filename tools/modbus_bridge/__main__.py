"""A reference waveform bridge: mains of 50 Hz at 20 kHz in real time, with the registers of docs/modbus-bridge.

    python -m tools.modbus_bridge --port 5020 [--phases 3] [--server double]

`--server pymodbus` uses pymodbus' server, `--server double` the one of tests/doubles/modbus. They differ as
docs/modbus-bridge/README.md says.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
import threading

from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from tests.doubles.modbus import ModbusFault, ModbusTcpDouble, WaveformBridge
from tests.doubles.waveform import WaveTable

_READS = (3, 4)
_ANY_UNIT = 0
"""pymodbus' number of the device that answers for all units."""


def simulated_device(bridge: WaveformBridge) -> SimDevice:
    """pymodbus' device with the registers of the bridge; they are filled just before each read."""

    async def fill(
        function: int, start: int, address: int, count: int, now: list[int], written: list[int] | list[bool] | None
    ) -> ExcCodes | None:
        if function not in _READS or written is not None:
            return ExcCodes.ILLEGAL_FUNCTION
        try:
            now[address - start : address - start + count] = bridge.read(function, address, count)
        except ModbusFault as fault:
            return ExcCodes(fault.code)
        return None

    size = bridge.slot0 + bridge.slots * bridge.stride
    registers = SimData(0, count=size, values=0, datatype=DataType.REGISTERS)
    return SimDevice(_ANY_UNIT, simdata=[registers], action=fill)


async def _serve_pymodbus(bridge: WaveformBridge, host: str, port: int) -> None:
    server = ModbusTcpServer(simulated_device(bridge), address=(host, port))
    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    await server.serve_forever(background=True)
    await ended.wait()
    await server.shutdown()  # type: ignore[no-untyped-call]


def _serve_double(bridge: WaveformBridge, host: str, port: int) -> None:
    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    with ModbusTcpDouble(dict.fromkeys(range(256), bridge), host, port), contextlib.suppress(KeyboardInterrupt):
        ended.wait()


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tools.modbus_bridge", description=__doc__.splitlines()[0])
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=5020)
    parser.add_argument("--phases", type=int, choices=(1, 2, 3), default=3)
    parser.add_argument("--server", choices=("pymodbus", "double"), default="pymodbus")
    return parser.parse_args()


def main() -> None:
    """Serve until SIGINT or SIGTERM."""
    chosen = _arguments()
    bridge = WaveformBridge(WaveTable(phases=chosen.phases))
    print(
        f"Waveform bridge on {chosen.host}:{chosen.port}: {bridge.channels} channels, "
        f"{bridge.slots} slots of {bridge.stride} registers from {bridge.slot0} ({chosen.server})",
        flush=True,
    )
    if chosen.server == "double":
        _serve_double(bridge, chosen.host, chosen.port)
    else:
        asyncio.run(_serve_pymodbus(bridge, chosen.host, chosen.port))


if __name__ == "__main__":
    main()
