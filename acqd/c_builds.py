"""All C that acqd compiles: sources, flags, and what is done where there is no compiler.

The libraries for metering and training are compiled at first use, or beforehand in a wheel. The sources of an FMU are
written for every model. Imports nothing but the standard library, so that a wheel can be built where numpy is not
installed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from acqd.instruction_sets import INSTRUCTION_SETS, InstructionSet

_PACKAGE = Path(__file__).parent
_SHARED = ("-fPIC", "-shared")
_COMMON = ("-std=gnu11", *_SHARED, "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")
# equal to the prediction of the bundle on every platform and processor: no contraction, no relaxed mathematics
FMU_FLAGS = ("-std=c99", "-O2", *_SHARED, "-fvisibility=hidden", "-ffp-contract=off", "-g0")
WINDOW_FALLBACK = "metering with numpy takes more than twenty times as long"
QUALITY_FALLBACK = "power quality and events with numpy take several times as long"
TICKS_FALLBACK = "MAIN_FAST waits in Python, which costs more of the processor"
SWITCHING_FALLBACK = "loads that switch are searched with numpy, which takes several times as long"
FLAC_FALLBACK = "archived samples are read through libsndfile, which takes twice as long"
FIRST_ORDER_FALLBACK = "the lag of the supply is computed by scipy, which takes several times as long"
RIGID_BODY_FALLBACK = "joint torques are computed with numpy, which takes four to eight times as long"
LSTM_FALLBACK = "train with --compute torch"
FMU_FALLBACK = "acqd[fmu] brings zig"


@dataclass(frozen=True, slots=True)
class CBuild:
    """A shared library to be compiled."""

    name: str
    sources: tuple[Path, ...]
    flags: tuple[str, ...]
    fallback: str
    """What is done without a compiler, in words."""
    headers: tuple[Path, ...] = ()
    """Files beside the sources that these include."""

    @property
    def arguments(self) -> list[str]:
        """Arguments of the compiler."""
        return [*self.flags, *map(str, self.sources)]


def window(channels: int, instructions: InstructionSet) -> CBuild:
    """The metering of windows of so many channels."""
    flags = ("-O2", *_COMMON, "-w", *instructions.options, f"-DCHANNELS={channels}")
    folder = _PACKAGE / "metering" / "kernel"
    name, headers = f"window-{instructions.name}-{channels}", (folder / "vectors.h",)
    return CBuild(name, (folder / "window.c",), flags, WINDOW_FALLBACK, headers)


def quality(instructions: InstructionSet) -> CBuild:
    """Power quality and events."""
    flags = ("-O3", *_COMMON, "-Wall", "-Wextra", *instructions.options)
    folder = _PACKAGE / "metering" / "kernel"
    name, headers = f"quality-{instructions.name}", (folder / "vectors.h",)
    return CBuild(name, (folder / "quality.c",), flags, QUALITY_FALLBACK, headers)


def ticks() -> CBuild:
    """The cycles of MAIN_FAST; nothing in them gains from wide vectors."""
    source = _PACKAGE / "plc" / "ticks.c"
    return CBuild("ticks", (source,), ("-O2", *_COMMON, "-Wall", "-Wextra"), TICKS_FALLBACK)


def switching() -> CBuild:
    """The search for loads that switch; equal to numpy to the last bit, so without contraction."""
    source = _PACKAGE / "discrepancy" / "loads" / "switching.c"
    return CBuild("switching", (source,), ("-O2", "-std=c99", *_SHARED, "-ffp-contract=off"), SWITCHING_FALLBACK)


def flac(instructions: InstructionSet) -> CBuild:
    """Reading archived samples."""
    source = _PACKAGE / "archive" / "flac.c"
    flags = ("-O3", *_COMMON, "-Wall", "-Wextra", *instructions.options)
    return CBuild(f"flac-{instructions.name}", (source,), flags, FLAC_FALLBACK)


def rigid_body(instructions: InstructionSet) -> CBuild:
    """Joint torques; equal on every processor, so without contraction."""
    source = _PACKAGE / "robot" / "rigid_body.c"
    flags = ("-O3", "-std=gnu11", *_SHARED, "-ffp-contract=off", "-Wall", "-Wextra", *instructions.options)
    return CBuild(f"rigid-body-{instructions.name}", (source,), flags, RIGID_BODY_FALLBACK)


def first_order(instructions: InstructionSet) -> CBuild:
    """First-order filters; equal to scipy on every processor, so without contraction."""
    source = _PACKAGE / "models" / "first_order.c"
    flags = ("-O3", "-std=gnu11", *_SHARED, "-ffp-contract=off", "-Wall", "-Wextra", *instructions.options)
    return CBuild(f"first-order-{instructions.name}", (source,), flags, FIRST_ORDER_FALLBACK)


def lstm(instructions: InstructionSet) -> CBuild:
    """Loss and gradient of an LSTM."""
    flags = ("-O3", *_COMMON, *instructions.options, f"-DV={instructions.lanes}")
    source = _PACKAGE / "models" / "networks" / "fused" / "lstm.c"
    return CBuild(f"lstm-{instructions.name}", (source,), flags, LSTM_FALLBACK)


def fmu(platform: str, sources: Sequence[Path], include: Path) -> CBuild:
    """The library of an FMU, from the sources that were written for its model."""
    return CBuild(f"fmu-{platform}", tuple(sources), (*FMU_FLAGS, f"-I{include}"), FMU_FALLBACK)


def all_builds(machine: str) -> list[CBuild]:
    """Every library of a wheel for processors of the kind `machine`, as `platform.machine()` calls it."""
    sets = [each for each in INSTRUCTION_SETS if machine in ("x86_64", "AMD64") or not each.needs]
    return [
        ticks(),
        switching(),
        *(
            build
            for each in sets
            for build in (
                *(window(n, each) for n in (2, 4, 6)),
                quality(each),
                rigid_body(each),
                first_order(each),
                lstm(each),
                flac(each),
            )
        ),
    ]
