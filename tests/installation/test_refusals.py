"""What an installation and a restore refuse before anything is changed."""

from __future__ import annotations

import pytest

from tests.commands import acqd_here, refused
from tests.installation.roots import NEEDS, contents, installed

pytestmark = NEEDS


def folder(path):
    path.mkdir(parents=True)


def text(path, content=""):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)


def two_lines(path):
    text(path, "one\ntwo\n")


def binary(path):
    text(path)
    path.write_bytes(b"\xff\xfe\x00")


def dangling(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.symlink_to("nowhere")


PLACES = {
    "etc/mosquitto/conf.d": (text, "is no folder, but"),
    "etc/systemd/system/acqd.service": (folder, "is a folder, not a file; move it away"),
    "etc/acqd/acqd.toml": (dangling, "is a link that leads nowhere, not a file; move it away"),
    "etc/acqd/box.password": (text, "is empty; delete it, and a new password is made"),
    "etc/acqd/acqd-sink.password": (two_lines, "is not one line; delete it, and a new password is made"),
    "etc/acqd/viewer.password": (binary, "is no text; move it away, and a new one is made"),
    "etc/mosquitto/acqd.passwords": (folder, "is a folder, not a file; move it away"),
}


@pytest.mark.parametrize("place", PLACES)
def test_a_place_that_cannot_be_filled_is_refused_before_the_first_file(place, root):
    make, said = PLACES[place]
    make(root / place)
    before = contents(root)
    line = refused(acqd_here("service", "install", "--root", root, "--program", "/bin/true"))
    assert said in line and str(root / place) in line
    assert contents(root) == before


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--device", "acqd-sink"), "--device acqd-sink: a service of that name logs in at the broker"),
        (("--device", "viewer"), "--device viewer: a service of that name logs in at the broker"),
        (("--program", "bin/acqd"), "--program 'bin/acqd': expected an absolute path"),
        (("--program", "/opt/my programs/acqd"), "expected an absolute path"),
        (("--archive", "/etc/group"), "--archive /etc/group: is a file, not a folder"),
    ],
)
def test_options_that_no_unit_could_use_are_refused(options, said, root):
    before = contents(root)
    program = () if "--program" in options else ("--program", "/bin/true")
    assert said in refused(acqd_here("service", "install", "--root", root, *program, *options))
    assert contents(root) == before


def test_a_check_of_a_backup_is_no_restore(root, tmp_path_factory):
    installed(root)
    file = tmp_path_factory.mktemp("backup") / "b.tar.gz"
    assert acqd_here("service", "backup", "--root", root, "--out", file).returncode == 0
    assert "give one" in refused(acqd_here("service", "restore", file, "--check", "--yes", "--root", root))
