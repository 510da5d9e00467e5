"""Process of the segment: frames on a raw socket, commands on standard input, answers on standard output."""

from __future__ import annotations

import argparse
import gc
import json
import os
import select
import socket
import sys
from collections.abc import Sequence
from typing import Final

from .clock import RealClock, VirtualClock
from .commands import apply
from .objects import Firmware
from .segment import Segment
from .terminal import EL3783_PRODUCT

ETHERTYPE: Final = 0x88A4
SOURCE_MAC: Final = 6
LOCALLY_ADMINISTERED: Final = 0x02


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until {"quit": true} or the end of standard input; 1: the interface cannot be opened."""
    options = _options(arguments)
    clock = VirtualClock() if options.clock == "lockstep" else RealClock(options.drift_ppm)
    segment = Segment(
        clock, options.terminals, advance_ns=options.advance_ns, product=options.product, firmware=options.firmware
    )
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE)) as wire:
        try:
            wire.bind((options.interface, ETHERTYPE))
        except OSError as error:
            _say({"ready": False, "error": f"interface {options.interface}: {error}"})
            return 1
        # A collection would delay a frame by milliseconds; nothing here makes cycles.
        gc.collect()
        gc.freeze()
        gc.disable()
        _say({"ready": True})
        _serve(segment, wire)
    return 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.doubles.ethercat", description=__doc__)
    parser.add_argument("--interface", required=True, help="end of a veth pair")
    parser.add_argument("--terminals", type=int, choices=(1, 2, 3), default=1)
    parser.add_argument("--clock", choices=("lockstep", "real"), default="lockstep")
    parser.add_argument("--advance-ns", type=int, help="virtual time of one cyclic frame; default: one block")
    parser.add_argument("--drift-ppm", type=float, default=0.0, help="rate error of the real clock")
    parser.add_argument("--product", type=lambda text: int(text, 0), default=EL3783_PRODUCT, help="of terminal 0")
    parser.add_argument("--firmware", type=lambda text: Firmware(**json.loads(text)), help="JSON of objects.Firmware")
    return parser.parse_args(arguments)


def _serve(segment: Segment, wire: socket.socket) -> None:
    poller = select.poll()
    poller.register(wire, select.POLLIN)
    poller.register(sys.stdin, select.POLLIN)
    frame = bytearray(2048)
    pending = b""
    while True:
        for descriptor, _ in poller.poll():
            if descriptor == wire.fileno():
                _forward(segment, wire, frame)
                continue
            chunk = os.read(descriptor, 65536)
            if not chunk:
                return
            *lines, pending = (pending + chunk).split(b"\n")
            if not all(_obey(segment, line) for line in lines):
                return


def _forward(segment: Segment, wire: socket.socket, frame: bytearray) -> None:
    try:
        length = wire.recv_into(frame)
        if segment.handle(frame, length):
            frame[SOURCE_MAC] ^= LOCALLY_ADMINISTERED
            wire.send(memoryview(frame)[:length])
    except OSError:
        # The interface went down; frames pass again when it comes back.
        return


def _obey(segment: Segment, line: bytes) -> bool:
    """Answer one command; False: the process shall end."""
    try:
        command = json.loads(line)
    except ValueError as error:
        _say({"error": f"no JSON: {error}"})
        return True
    if command.get("quit"):
        _say({"ok": True})
        return False
    _say(apply(segment, command))
    return True


def _say(answer: object) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
