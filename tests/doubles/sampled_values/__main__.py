"""The double as a process: frames out of an interface, commands on stdin, answers on stdout."""

from __future__ import annotations

import json
import os
import select
import sys
from typing import Any

from tests.doubles.sampled_values.arguments import parsed, sources
from tests.doubles.sampled_values.commands import answer
from tests.doubles.sampled_values.unit import MergingUnit


class CommandLines:
    """Lines of stdin without waiting for them. The buffer of `sys.stdin` would hide lines from `select`."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._rest = b""

    def wait(self, timeout_s: float | None) -> list[bytes] | None:
        """Whole lines that have arrived after at most `timeout_s`; None at the end of the input."""
        if not select.select([self._descriptor], [], [], timeout_s)[0]:
            return []
        data = os.read(self._descriptor, 65536)
        *lines, self._rest = (self._rest + data).split(b"\n")
        return lines if data else None


def _reply(fields: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(fields) + "\n")
    sys.stdout.flush()


def _carry_out(unit: MergingUnit, line: bytes) -> bool:
    """Answers one line; False after the command quit."""
    try:
        fields = json.loads(line)
    except ValueError as error:
        _reply({"error": f"no JSON: {error}"})
        return True
    result = answer(unit, fields) if isinstance(fields, dict) else {"error": "no JSON object"}
    _reply(result)
    return "quit" not in result


def _serve(unit: MergingUnit, commands: CommandLines) -> None:
    while (lines := commands.wait(unit.wait_s())) is not None:
        if not all(_carry_out(unit, line) for line in lines if line.strip()):
            return
        unit.send_due()


def main() -> int:
    """Runs until the end of stdin; returns 2 where the interface, file or options do not serve."""
    options = parsed()
    try:
        unit = MergingUnit(options.interface, sources(options), options.clock)
        if options.autostart:
            unit.start()
    except (OSError, ValueError) as error:
        print(f"sampled_values: {error}", file=sys.stderr)
        return 2
    _reply({"ready": True})
    _serve(unit, CommandLines(sys.stdin.fileno()))
    unit.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
