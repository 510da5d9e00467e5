"""C libraries that a wheel brings along."""

import platform

import pytest

from acqd import compiling
from acqd.c_builds import all_builds, lstm, window
from acqd.errors import OperationError
from acqd.instruction_sets import INSTRUCTION_SETS, best_instruction_set
from acqd.metering.kernel.compiled import library


def test_a_wheel_holds_what_any_processor_of_its_kind_looks_for():
    names = {compiling.file_name(build) for build in all_builds("x86_64")}
    for instructions in INSTRUCTION_SETS:
        wanted = [lstm(instructions), *(window(channels, instructions) for channels in (2, 4, 6))]
        assert {compiling.file_name(build) for build in wanted} <= names
    others = {build.name for build in all_builds("aarch64")}
    assert others == {"ticks", "lstm-portable", "window-portable-2", "window-portable-4", "window-portable-6"}


def test_a_library_of_the_wheel_needs_neither_compiler_nor_cache(tmp_path, monkeypatch):
    if compiling.system_compiler() is None:
        pytest.skip("no C compiler to make the library with")
    build = window(2, best_instruction_set())
    assert build.name in {each.name for each in all_builds(platform.machine())}
    made = compiling.cached_library(build)
    (tmp_path / made.name).write_bytes(made.read_bytes())
    monkeypatch.setattr(compiling, "PREBUILT", tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "none"))
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    assert library(2)._name == str(tmp_path / made.name)
    with pytest.raises(OperationError, match="no C compiler"):
        library(4)
