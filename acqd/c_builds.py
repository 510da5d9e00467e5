"""All C libraries of acqd: each with its source and flags, compiled at first use, or beforehand in a wheel.

Imports nothing but the standard library, so that a wheel can be built where numpy is not installed. The sources of FMUs
are not among them: they are generated for every model (`acqd.fmu.platforms`).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from acqd.instruction_sets import INSTRUCTION_SETS, InstructionSet

_PACKAGE = Path(__file__).parent
_COMMON = ("-std=gnu11", "-fPIC", "-shared", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")


@dataclass(frozen=True, slots=True)
class CBuild:
    """A shared library to be compiled."""

    name: str
    source: Path
    flags: tuple[str, ...]


def window(channels: int, instructions: InstructionSet) -> CBuild:
    """The metering of windows of so many channels."""
    flags = ("-O2", *_COMMON, "-w", *instructions.options, f"-DCHANNELS={channels}")
    return CBuild(f"window-{instructions.name}-{channels}", _PACKAGE / "metering" / "kernel" / "window.c", flags)


def lstm(instructions: InstructionSet) -> CBuild:
    """Loss and gradient of an LSTM."""
    flags = ("-O3", *_COMMON, *instructions.options, f"-DV={instructions.lanes}")
    return CBuild(f"lstm-{instructions.name}", _PACKAGE / "models" / "networks" / "fused" / "lstm.c", flags)


def all_builds(machine: str) -> list[CBuild]:
    """Every library for processors of the kind `machine`, as `platform.machine()` calls it."""
    sets = [each for each in INSTRUCTION_SETS if machine in ("x86_64", "AMD64") or not each.needs]
    return [build for each in sets for build in (*(window(channels, each) for channels in (2, 4, 6)), lstm(each))]
