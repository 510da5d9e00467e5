"""What `acqd doctor` says of compiled C: metering, training of networks, export of FMUs."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

from acqd.c_builds import FMU_FALLBACK, lstm
from acqd.compiling import NO_COMPILER, PREBUILT, existing_library, system_compiler, why_unavailable
from acqd.daemon.finding import Finding
from acqd.instruction_sets import best_instruction_set


def compiled_c() -> Iterator[Finding]:
    """One finding per use. Metering without C is a warning; a measurement PC neither trains nor exports."""
    yield _metering()
    yield Finding("training", "ok", _training())
    yield Finding("FMU export", "ok", _fmu_export())


def _metering() -> Finding:
    from acqd.metering.kernel import why_not  # compiles at first use

    reason = why_not()
    if reason is None:
        return Finding("metering", "ok", f"compiled, {best_instruction_set().name}")
    return Finding("metering", "warn", f"numpy ({reason})", "install a C compiler")


def _training() -> str:
    instructions = best_instruction_set()
    build = lstm(instructions)
    existing = existing_library(build)
    if existing is not None:
        return f"compiled, {instructions.name}, from the {'wheel' if existing.parent == PREBUILT else 'cache'}"
    return why_unavailable(build) or f"compiled at first use by {system_compiler()}, {instructions.name}"


def _fmu_export() -> str:
    zig = "zig" if find_spec("ziglang") is not None else ""
    compilers = " and ".join(filter(None, (system_compiler(), zig)))
    return f"compiled by {compilers}" if compilers else f"{NO_COMPILER}; otherwise {FMU_FALLBACK}"
