"""`acqd service backup` and `restore`: what is restored was verified, and nothing is half written."""

from __future__ import annotations

import gzip
import io
import json
import os
import re
import sqlite3
import subprocess
import tarfile
import threading
from pathlib import Path

import pytest

from acqd.installation.backup_file import manifest_of
from acqd.storage.database import open_database
from acqd.storage.writer import Writer
from tests.commands import acqd_here, refused
from tests.installation.roots import NEEDS, bare, contents, installed
from tests.storage.rows import message, row

pytestmark = [*NEEDS, pytest.mark.xdist_group("backup")]  # one database is made


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    """An installation with rows in the database and in the spool."""
    root = bare(tmp_path_factory.mktemp("pristine"))
    installed(root, "--device", "hall-3", "--rights", "serial")
    state = root / "var/lib/acqd"
    store(state / "acqd.sqlite", [message(row(k)) for k in range(50)])
    (state / "spool-hall-3").mkdir()
    (state / "spool-hall-3/0000000000000001.seg").write_bytes(os.urandom(5000))
    (state / "energy-hall-3.json").write_text('{"W": 1}')
    (state / "archive-hall-3").mkdir()
    (state / "archive-hall-3/samples.flac").write_bytes(b"gigabytes")
    return root


@pytest.fixture
def root(pristine, tmp_path):
    """A copy of it, with its owners."""
    subprocess.run(["cp", "-a", f"{pristine}/.", tmp_path / "root"], check=True)
    return tmp_path / "root"


def store(database, stored):
    engine = open_database(str(database))
    Writer(engine).write(stored)
    engine.dispose()


def backup(root, file):
    done = acqd_here("service", "backup", "--root", root, "--out", file, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def restored(root, file, *options):
    return acqd_here("service", "restore", file, "--root", root, "--program", "/bin/true", *options)


def rows(root):
    with sqlite3.connect(root / "var/lib/acqd/acqd.sqlite") as database:
        return database.execute("SELECT count(*) FROM power").fetchone()[0]


def test_a_backup_restores_everything_on_another_computer(root, tmp_path_factory):
    file = tmp_path_factory.mktemp("disk") / "b.tar.gz"
    told = backup(root, file)
    assert told["databases"] == ["/var/lib/acqd/acqd.sqlite"] and file.stat().st_mode & 0o777 == 0o600
    assert not list(file.parent.glob(".*"))
    other = bare(tmp_path_factory.mktemp("other"))
    checked = restored(other, file, "--check", "--json")
    assert json.loads(checked.stdout)["rows"] == {"/var/lib/acqd/acqd.sqlite": 50}
    assert sorted(path.name for path in other.rglob("*")) == ["etc", "group"]
    assert restored(other, file).returncode == 0
    before, after = contents(root), contents(other)
    for path, kept in before.items():
        if path.startswith(
            ("/etc/acqd", "/var/lib/acqd/spool", "/var/lib/acqd/energy", "/etc/mosquitto", "/etc/systemd")
        ):
            assert after[path] == kept, path
    assert rows(other) == 50 and "/etc/systemd/system/acqd.service.d/serial.conf" in after
    assert "/var/lib/acqd/archive-hall-3/samples.flac" not in after
    assert acqd_here("service", "update", "--root", other, "--program", "/bin/true").stdout == "nothing to do\n"


def test_a_restore_replaces_nothing_without_yes_and_keeps_what_was_there(root, tmp_path):
    file = tmp_path / "b.tar.gz"
    backup(root, file)
    store(root / "var/lib/acqd/acqd.sqlite", [message(row(k)) for k in range(50, 60)])
    (root / "var/lib/acqd/spool-hall-3/0000000000000002.seg").write_text("later")
    before = contents(root)
    assert "--yes" in refused(restored(root, file)) and contents(root) == before
    assert restored(root, file, "--yes").returncode == 0
    assert rows(root) == 50 and not (root / "var/lib/acqd/spool-hall-3/0000000000000002.seg").exists()
    [aside] = (root / "var/lib").glob("acqd.before-*")
    assert (aside / "spool-hall-3/0000000000000002.seg").read_text() == "later" and (aside / "acqd.sqlite").exists()
    assert (root / "var/lib/acqd/archive-hall-3/samples.flac").read_bytes() == b"gigabytes"  # not in the backup


def test_a_backup_is_consistent_while_the_sink_writes(root, tmp_path):
    engine, stop = open_database(str(root / "var/lib/acqd/acqd.sqlite")), threading.Event()

    def write():
        for k in range(100, 10_000):
            Writer(engine).write([message(row(k))])
            if stop.is_set():
                return

    writing = threading.Thread(target=write)
    writing.start()
    try:
        backup(root, tmp_path / "b.tar.gz")
    finally:
        stop.set()
        writing.join()
    counted = json.loads(restored(root, tmp_path / "b.tar.gz", "--check", "--json").stdout)["rows"]
    assert 50 <= counted["/var/lib/acqd/acqd.sqlite"] <= rows(root)


def damaged(file, how):
    """A copy of a backup with one thing wrong."""
    out = file.with_name(f"{how}.tar.gz")
    if how == "cut":
        out.write_bytes(file.read_bytes()[:-3000])
    elif how == "text":
        out.write_text("no archive")
    else:
        with tarfile.open(file) as source, tarfile.open(out, "w:gz") as target:
            for member in source:
                content = source.extractfile(member).read()
                if how == "changed" and member.name.endswith("acqd.toml"):
                    content = content.replace(b"hall-3", b"hall-4")
                if how == "escape" and member.name == "manifest.json":
                    content = content.replace(b"/etc/acqd/viewer.password", b"/etc/acqd/../shadow")
                if how == "system" and member.name == "manifest.json":
                    content = content.replace(b"/etc/acqd/viewer.password", b"/etc/cron.d/acqd")
                if how == "database" and member.name.endswith("acqd.sqlite"):
                    content = content[:4096] + b"\xff" * (len(content) - 4096)
                if how == "newer" and member.name == "manifest.json":
                    content = content.replace(b'"format": 1', b'"format": 2')
                member.size = len(content)
                target.addfile(member, io.BytesIO(content))
    return out


WRONG = {
    "cut": "damaged, or no backup|has no manifest", "text": "damaged, or no backup", "newer": "newer acqd",
    "changed": "acqd.toml is not what was stored", "database": "not what was stored",
    "escape": "expected an absolute path", "system": "no file of acqd",
}  # fmt: skip


def test_a_damaged_backup_is_refused_and_changes_nothing(root, tmp_path):
    file = tmp_path / "b.tar.gz"
    backup(root, file)
    before = contents(root)
    for how, why in WRONG.items():
        said = refused(restored(root, damaged(file, how), "--yes"))
        assert re.search(why, said), (how, said)
        assert contents(root) == before


def test_a_name_that_cannot_be_exchanged_puts_all_back(root, tmp_path, monkeypatch):
    file = tmp_path / "b.tar.gz"
    backup(root, file)
    (root / "var/lib/acqd/energy-hall-3.json").write_text('{"W": 2}')
    before, rename = contents(root), Path.rename

    def failing(self, target):
        if self.name == "acqd.sqlite" and ".restore-" in str(self):
            raise OSError(28, "No space left on device", str(target))
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", failing)
    done = restored(root, file, "--yes")
    assert done.returncode == 1 and "everything is as it was" in done.stderr
    after = contents(root)
    assert {path: after[path] for path in before} == before and not [p for p in after if ".restore-" in p]


def test_a_backup_that_cannot_be_written_leaves_nothing(root, tmp_path):
    assert "no folder" in refused(acqd_here("service", "backup", "--root", root, "--out", tmp_path / "x/y.tar.gz"))
    (tmp_path / "bare").mkdir()
    empty = bare(tmp_path / "bare")
    assert "nothing of acqd" in refused(acqd_here("service", "backup", "--root", empty, "--out", tmp_path / "y"))
    with gzip.open(tmp_path / "z.tar.gz", "wb") as file:
        file.write(b"\0" * 1024)
    assert "has no manifest" in refused(restored(root, tmp_path / "z.tar.gz", "--check"))
    assert "no such file" in refused(restored(root, tmp_path / "nothing.tar.gz"))


def test_a_backup_replaces_no_file(root, tmp_path):
    file = tmp_path / "b.tar.gz"
    backup(root, file)
    before = file.read_bytes()
    line = refused(acqd_here("service", "backup", "--root", root, "--out", file))
    assert str(file) in line and "replaces no file" in line
    assert file.read_bytes() == before and list(tmp_path.glob("*.gz*")) == [file] and not list(tmp_path.glob(".*"))


def test_what_a_backup_leaves_out_is_said(root, tmp_path):
    config = root / "etc/acqd/acqd.toml"
    config.write_text(
        config.read_text().replace('database = "acqd.sqlite"', 'database = "postgresql://u:secret@h/acqd"')
    )
    told = backup(root, tmp_path / "b.tar.gz")
    assert any("pg_dump" in one for one in told["left_out"]) and "secret" not in str(told)
    assert manifest_of(tmp_path / "b.tar.gz").rights == ["serial"]
