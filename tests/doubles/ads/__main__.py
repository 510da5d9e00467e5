"""`python -m tests.doubles.ads`: the double as a process, with JSON commands on the standard input."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from typing import Any

from tests.doubles.ads.double import AdsDouble, Settings


def main(arguments: Sequence[str] | None = None) -> None:
    """Serve until {"quit": true} or the end of the standard input."""
    with AdsDouble(_parse(arguments)) as double:
        _write({"ready": True})
        for line in sys.stdin:
            command: dict[str, Any] = {}
            try:
                command = _object(line)
                _write(double.command(**command))
            except ValueError as error:
                _write({"error": str(error)})
            if command.get("quit"):
                break


def _parse(arguments: Sequence[str] | None) -> Settings:
    defaults = Settings()
    parser = argparse.ArgumentParser(prog="tests.doubles.ads", description=__doc__)
    parser.add_argument("--host", default=defaults.host, help="loopback address; the AMS net id is HOST.1.1")
    parser.add_argument("--clock", choices=["lockstep", "real"], default=defaults.clock)
    parser.add_argument("--drift-ppm", type=float, default=defaults.drift_ppm)
    parser.add_argument("--frames", type=int, default=defaults.frames, help="samples per channel and slot")
    parser.add_argument("--phases", type=int, choices=[1, 2, 3], default=defaults.phases)
    parser.add_argument("--slots", type=int, default=defaults.slots)
    parser.add_argument("--advance", type=int, default=defaults.advance, help="slots per read of the head (lockstep)")
    parser.add_argument("--route", action="append", default=[], help="AMS net id of a client; without it, all may read")
    given: dict[str, Any] = vars(parser.parse_args(arguments))
    return Settings(routes=tuple(given.pop("route")), **given)


def _object(line: str) -> dict[str, Any]:
    command = json.loads(line)
    if not isinstance(command, dict):
        raise ValueError("a command is a JSON object on one line")
    return command


def _write(answer: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
