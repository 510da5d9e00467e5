"""The energy registers on disk."""

from __future__ import annotations

import errno
import multiprocessing
import os
import stat
from pathlib import Path
from unittest import mock

import pytest

from acqd.daemon import register as module
from acqd.daemon.instance import instance_id
from acqd.daemon.register import RegisterFile, Run, greater, registers_of


def test_registers_continue_from_the_greater_reading():
    assert greater(None, None, 1) is None
    assert greater([(1.0, 0.0)], None, 1) == [(1.0, 0.0)]
    assert greater([(1.0, 0.5)], [(0.9, 0.6)], 1) == [(1.0, 0.6)]
    assert greater([(1.0, 0.5)], [(5.0, 5.0)] * 3, 1) == [(1.0, 0.5)], "of another number of phases"


def test_reactive_energy_and_demand_are_kept_beside_and_damage_costs_only_them(tmp_path, caplog):
    registers = registers_of(1, 0.04, 0.0, None)
    registers.channels["L1"].reactive[3] = 1.5
    RegisterFile(tmp_path, "cell1").save([(1.0, 0.0)], registers.state())
    file = RegisterFile(tmp_path, "cell1")
    assert file.load(1) == [(1.0, 0.0)]
    assert registers_of(1, 0.04, 0.0, file.others).reading("L1")["W_reactive_IV"] == 1.5
    assert registers_of(3, 0.04, 0.0, file.others).reading("L1")["W_reactive_IV"] == 0.0
    assert "start from zero" in caplog.text


def test_a_full_disk_is_said_once(tmp_path, caplog):
    register = RegisterFile(tmp_path / "none", "cell1")
    for _ in range(3):
        register.save([(1.0, 0.0)])
    assert caplog.text.count("cannot be written") == 1
    (tmp_path / "none").mkdir()
    register.save([(1.0, 0.0)])
    assert register.load(1) == [(1.0, 0.0)] and caplog.text.count("cannot be written") == 1


def test_a_disk_that_is_full_takes_the_register_all_the_same(tmp_path):
    """From the second time on, saving writes only into blocks that the two files have."""
    register, inodes = RegisterFile(tmp_path, "cell1"), set()
    for k in range(6):
        register.save([(float(k), 0.0)], {"k": "x" * (6_000 if k < 2 else 30)})
        assert RegisterFile(tmp_path, "cell1").load(1) == [(float(k), 0.0)]
        if k >= 1:
            inodes |= {(path.stat().st_ino, path.stat().st_blocks > 0) for path in tmp_path.glob("energy-cell1.*")}
    assert len(inodes) == 2 and sorted(path.name for path in tmp_path.iterdir()) == [
        "energy-cell1.json",
        "energy-cell1.new",
    ]


def test_names_are_on_the_disk_before_blocks_are_written_over_and_before_the_first_row(tmp_path, monkeypatch):
    """A disk may keep contents and lose names: then the last file would have the blocks of the next one, half written.

    And the run before would be asked for, not the one whose rows have left.
    """
    done, names = [], {"pwrite": "write", "replace": "name", "link": "name"}
    for name, what in names.items():
        real = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *args, real=real, what=what: (done.append(what), real(*args))[1])
    fsync = os.fsync

    def confirm(file):
        done.append("names confirmed" if stat.S_ISDIR(os.fstat(file).st_mode) else "content confirmed")
        fsync(file)

    monkeypatch.setattr(os, "fsync", confirm)
    register = RegisterFile(tmp_path, "cell1")
    register.save([(1.0, 0.0)], run=Run("boot", -1), first=True)
    assert done[-1] == "names confirmed"
    for k in range(3):
        done.clear()
        register.save([(float(k), 0.0)])
        assert done == ["names confirmed", "write", "content confirmed", "name", "name", "name"]


def test_a_file_system_that_confirms_no_names_takes_the_register(tmp_path, monkeypatch):
    """Some network shares answer EINVAL to fsync of a folder."""
    fsync = os.fsync

    def refuse(file):
        if stat.S_ISDIR(os.fstat(file).st_mode):
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        fsync(file)

    monkeypatch.setattr(os, "fsync", refuse)
    register = RegisterFile(tmp_path, "cell1")
    register.save([(3.0, 0.0)], first=True)
    assert register.load(1) == [(3.0, 0.0)]


def test_a_register_that_the_disk_does_not_give_out_at_once_is_asked_for_again(tmp_path):
    RegisterFile(tmp_path, "cell1").save([(7.0, 0.0)])
    real, failures = module.read_regular, [errno.EIO, errno.ESTALE]

    def read(path, most):
        if failures:
            raise OSError(failures[0], os.strerror(failures.pop()))
        return real(path, most)

    with mock.patch.object(module, "read_regular", read):
        assert RegisterFile(tmp_path, "cell1").load(1) == [(7.0, 0.0)]
    failures += [errno.EIO] * 99
    with mock.patch.object(module, "read_regular", read), mock.patch.object(module, "_PATIENCE_S", 0.0):
        assert RegisterFile(tmp_path, "cell1").load(1) is None
    assert (tmp_path / "energy-cell1.old").exists(), "kept for a person"


@pytest.mark.parametrize(
    "content",
    [
        b"[" * 100_000,
        b'{"phases": [{"import_kWh": 1' + b"0" * 400 + b', "export_kWh": 0}]}',
        b'{"run": {"boot": "b", "seq": 1e400, "closed": false, "start": ""}, "phases": 5}',
        b"\xff\xfe",
        b"3",
    ],
    ids=["deep", "integer", "infinite", "bytes", "number"],
)
def test_a_file_of_whatever_content_is_kept_and_ends_nothing(tmp_path, content):
    path = tmp_path / "energy-cell1.json"
    path.write_bytes(content)
    register = RegisterFile(tmp_path, "cell1")
    assert register.unfinished() is None and register.load(1) is None and register.refused
    register.save([(1.0, 0.0)], first=True)
    assert path.with_suffix(".old").read_bytes() == content and register.load(1) == [(1.0, 0.0)]


def test_a_pipe_in_the_place_of_the_file_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "energy-cell1.json")
    with mock.patch.object(module, "_PATIENCE_S", 0.0):
        assert RegisterFile(tmp_path, "cell1").load(1) is None
    os.mkfifo(tmp_path / "instance")
    assert instance_id(tmp_path) == instance_id(tmp_path)


def test_what_others_have_a_name_for_is_not_written_over(tmp_path):
    """Backups of hard links (`cp -al`, `rsync --link-dest`), links and pipes where the next readings go."""
    register = RegisterFile(tmp_path, "box")
    spare, backup, other = tmp_path / "energy-box.new", tmp_path / "backup.json", tmp_path / "other"
    register.save([(1.0, 0.0)])
    os.link(tmp_path / "energy-box.json", backup)
    kept = backup.read_bytes()
    for reading in (2.0, 3.0, 4.0):
        register.save([(reading, 0.0)])
    assert backup.read_bytes() == kept
    other.write_text("of somebody else")
    for odd in (lambda: spare.symlink_to(other), lambda: os.mkfifo(spare)):
        spare.unlink()
        odd()
        register.save([(5.0, 0.0)])
        assert register.trouble == ""
    assert register.load(1) == [(5.0, 0.0)] and other.read_text() == "of somebody else"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can be another user")
def test_files_that_root_has_made_hold_no_service_up(tmp_path):
    tmp_path.chmod(0o777)
    for reading in (1.0, 2.0, 3.0):
        RegisterFile(tmp_path, "box").save([(reading, 0.0)])
    service = multiprocessing.get_context("fork").Process(target=_save_as_nobody, args=(tmp_path,))
    service.start()
    service.join()
    assert service.exitcode == 0 and RegisterFile(tmp_path, "box").load(1) == [(4.0, 0.0)]


def _save_as_nobody(folder):
    os.chdir(folder)  # those above it are closed to others
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
    register = RegisterFile(Path(), "box")
    register.save([(4.0, 0.0)])
    assert not register.trouble


def test_the_last_run_is_asked_about_where_the_disk_may_lack_its_end(tmp_path):
    register = RegisterFile(tmp_path, "cell1")
    assert register.unfinished() is None
    register.save([(1.0, 0.0)], run=Run("a", 7, closed=True))
    assert register.unfinished() is None, "it has ended in order"
    register.save([(1.0, 0.0)], run=Run("a", 8))
    assert register.unfinished() is None, "killed a moment ago: the kernel has what it wrote"
    os.utime(tmp_path / "energy-cell1.json", (1.0, 1.0))
    assert register.unfinished() == Run("a", 8), "the disk took nothing at the end"
    register.save([(1.0, 0.0)], run=Run("a", 9, start="00" * 16))
    assert register.unfinished() == Run("a", 9, start="00" * 16), "a power cut"
