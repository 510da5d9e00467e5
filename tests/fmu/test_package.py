"""The archive: its sources, and input that cannot be exported."""

import re
import subprocess
import zipfile

import pytest

from acqd.errors import UserError
from acqd.fmu.package import export_fmu
from acqd.models.bundle.bundle import save_bundle
from tests.builders import grey_bundle
from tests.fmu.bundles import make


def test_the_sources_alone_make_the_same_binary(made, tmp_path):
    """An importer on another platform compiles what is in the FMU and nothing else."""
    _, file = made("effects", "3.0")
    with zipfile.ZipFile(file) as archive:
        archive.extractall(tmp_path)
    folder = tmp_path / "sources"
    names = re.findall(r'SourceFile name="([^"]+)"', (folder / "buildDescription.xml").read_text())
    command = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-fPIC", "-shared"]
    done = subprocess.run(
        [*command, *names, "-o", "own.so", "-lm"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_bad_input_is_named_and_nothing_is_left(made, tmp_path, monkeypatch):
    made("grey_box")
    bundle = tmp_path / "b"
    save_bundle(bundle, grey_bundle())
    out = tmp_path / "x.fmu"
    with pytest.raises(UserError, match="no platform 'amiga'"):
        export_fmu(bundle, out, "2.0", ["amiga"], lambda _: None)
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="nothing was left behind"):
        export_fmu(bundle, tmp_path / "file" / "x.fmu", "2.0", ["linux64"], lambda _: None)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "file"))
    with pytest.raises(UserError, match="TMPDIR"):
        export_fmu(bundle, out, "2.0", ["linux64"], lambda _: None)
    monkeypatch.undo()
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("acqd.fmu.platforms.find_spec", lambda _: None)
    with pytest.raises(UserError, match="no C compiler found"):
        export_fmu(bundle, out, "2.0", ["linux64"], lambda _: None)
    with pytest.raises(UserError, match="needs zig"):
        export_fmu(bundle, out, "2.0", ["win64"], lambda _: None)
    assert not list(tmp_path.glob("*.fmu")) and not list(tmp_path.glob(".x*"))


@pytest.mark.slow
@pytest.mark.parametrize("platform", ["linux64", "darwin64"])
def test_clang_compiles_effects_for_processors_with_and_without_avx2(tmp_path, monkeypatch, platform):
    pytest.importorskip("ziglang")
    monkeypatch.setattr("acqd.fmu.platforms.system_compiler", lambda: None)
    exported = export_fmu(make("effects", tmp_path), tmp_path / "power.fmu", "2.0", [platform], lambda _: None)
    assert exported.compilers == {platform: "zig cc"}
