"""C libraries that a wheel brings along."""

import platform

import pytest

from acqd import compiling
from acqd.c_builds import CBuild, all_builds, first_order, flac, lstm, quality, rigid_body, window
from acqd.errors import OperationError, UserError
from acqd.fmu import platforms
from acqd.instruction_sets import INSTRUCTION_SETS, best_instruction_set
from acqd.metering.kernel.compiled import library


def test_a_wheel_holds_what_any_processor_of_its_kind_looks_for():
    names = {compiling.file_name(build) for build in all_builds("x86_64")}
    for instructions in INSTRUCTION_SETS:
        wanted = [
            lstm(instructions),
            quality(instructions),
            rigid_body(instructions),
            first_order(instructions),
            flac(instructions),
            *(window(channels, instructions) for channels in (2, 4, 6)),
        ]
        assert {compiling.file_name(build) for build in wanted} <= names
    others = {build.name for build in all_builds("aarch64")}
    windows = {f"window-portable-{channels}" for channels in (2, 4, 6)}
    portable = {f"{name}-portable" for name in ("first-order", "flac", "lstm", "quality", "rigid-body")}
    assert others == {"ticks", "switching"} | portable | windows


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


def test_every_kind_of_build_says_what_is_done_without_a_compiler(tmp_path, monkeypatch):
    monkeypatch.setattr(compiling, "PREBUILT", tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "none"))
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    build = lstm(best_instruction_set())
    assert compiling.why_unavailable(build).endswith("otherwise train with --compute torch")
    with pytest.raises(OperationError, match="otherwise train with --compute torch"):
        compiling.cached_library(build)
    with pytest.raises(OperationError, match="otherwise metering with numpy"):
        compiling.cached_library(window(2, best_instruction_set()))
    monkeypatch.setattr(platforms, "find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"otherwise acqd\[fmu\] brings zig"):
        platforms.build(platforms.PLATFORMS[platforms.here()], [], tmp_path, tmp_path / "model.so")


def test_training_without_a_compiler_uses_the_library_of_the_wheel(tmp_path, monkeypatch):
    build = lstm(best_instruction_set())
    if compiling.system_compiler() is None:
        pytest.skip("no C compiler to make the library with")
    made = compiling.cached_library(build)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "none"))
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(compiling, "PREBUILT", tmp_path)
    assert compiling.why_unavailable(build) is not None
    (tmp_path / made.name).write_bytes(made.read_bytes())
    assert compiling.why_unavailable(build) is None


def test_a_changed_source_or_flag_has_another_file(tmp_path):
    source = tmp_path / "one.c"
    source.write_text("int one(void) { return 1; }\n")
    build = CBuild("one", (source,), ("-O1",), "")
    names = {compiling.file_name(build), compiling.file_name(CBuild("one", (source,), ("-O2",), ""))}
    source.write_text("int one(void) { return 2; }\n")
    assert len(names | {compiling.file_name(build)}) == 3


def test_a_damaged_library_is_named_with_the_remedy(tmp_path, monkeypatch):
    build = lstm(best_instruction_set())
    (tmp_path / compiling.file_name(build)).write_bytes(b"no library")
    monkeypatch.setattr(compiling, "PREBUILT", tmp_path)
    with pytest.raises(OperationError, match="is damaged: remove it"):
        compiling.loaded_library(build)
